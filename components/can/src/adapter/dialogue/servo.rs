//! The dialogue with Feetech servos: one packet writes the goals of all servos of a line, one asks all of them, and they answer
//! one after the other.

use super::{Dialogue, Heard, Motion, Order};
use crate::adapter::{Link, OnTrip, WrongSetting};
use crate::feetech::{self, step};
use crate::frame::{DecodeError, Form, Frame, Id};
use crate::mit::{Feedback, Ranges, State};
use crate::servo::{self, Instruction, LONGEST};
use crate::table::Table;

/// Bytes of the longest packet that goes out.
const PACKET: usize = 64;

#[derive(Clone, Debug)]
pub(in crate::adapter) struct Servo {
    number: u8,
    ranges: Ranges,
    motion: Motion,
}

/// What is written into a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Written {
    /// Torque off.
    Off,
    /// Goal and torque together: it must not run to a goal of before.
    On(u16),
    /// The goal.
    Goal(u16),
}

impl Servo {
    /// Operating mode and limits of goals.
    pub(super) const CHECKS: u8 = 2;

    pub(super) fn new(table: &Table, index: usize) -> Self {
        Self { number: table.drives[index].node, ranges: table.ranges(index), motion: Motion::default() }
    }

    pub(super) fn is_from(&self, frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(self.number.into())
    }

    /// What an order writes; `None` for nothing.
    fn written(&mut self, order: &Order) -> Option<Written> {
        self.motion.begin(order);
        match order {
            Order::Check(_) => None,
            Order::Disable | Order::Rest => Some(Written::Off),
            Order::Enable => Some(Written::On(step(self.motion.position))),
            Order::Follow(command) => Some(Written::Goal(step(self.motion.target(command)))),
        }
    }

    pub(super) fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Heard, DecodeError> {
        let status = servo::read_status(frame.data())?;
        if status.servo != self.number {
            return Err(DecodeError::Device { found: status.servo, expected: self.number });
        }
        match (checking, status.data) {
            (Some(0), [mode]) => {
                let wrong = WrongSetting::OperatingMode { found: *mode };
                Ok(Heard::Setting((*mode != 0).then_some(wrong)))
            }
            (Some(1), [a, b, c, d]) => {
                let ends = [[*a, *b], [*c, *d]].map(|word| feetech::position(u16::from_le_bytes(word)));
                let needed = self.ranges.position.max.min(feetech::position(feetech::TURN as u16 - 1));
                // to a step, and the range of a turn is a step shorter above
                let covers = ends[0] <= 2e-3 - needed && ends[1] >= needed - 2e-3;
                let wrong = WrongSetting::Goals { found: ends, expected: self.ranges.position.max };
                Ok(Heard::Setting((!covers).then_some(wrong)))
            }
            (Some(_), data) => Err(DecodeError::Length { found: data.len(), expected: 4 }),
            (None, data) => self.state(data, status.error),
        }
    }

    fn state(&mut self, data: &[u8], error: u8) -> Result<Heard, DecodeError> {
        let told = feetech::State::decode(data)?;
        let told = feetech::State { status: told.status | error, ..told };
        (self.motion.position, self.motion.velocity) = (told.position, told.velocity);
        let state = match (told.fault(), told.is_enabled) {
            (Some(fault), _) => State::Fault(fault),
            (None, true) => State::Enabled,
            (None, false) => State::Disabled,
        };
        Ok(Heard::Feedback(Feedback {
            position: told.position,
            velocity: told.velocity,
            torque: told.load * self.ranges.torque.max,
            temperature: Some(told.temperature),
            voltage: Some(told.voltage),
            state,
        }))
    }

    /// Writes the packets of a cycle for all servos of a line, and notes after how many frames each has been asked.
    pub(in crate::adapter) fn write_line(
        links: &mut [Link],
        bus: usize,
        trip: Option<OnTrip>,
        cycle: u64,
        frames: &mut Vec<Frame>,
    ) {
        let before = frames.len();
        let mut out = Packets { frames };
        let mut goals = [
            Group::new(feetech::TORQUE_ENABLE, 1),
            Group::new(feetech::TORQUE_ENABLE, feetech::ENABLE_BYTES),
            Group::new(feetech::GOAL_POSITION, 2),
        ];
        let mut askable = [false; 3];
        for link in links.iter_mut().filter(|link| link.bus() == bus && !link.is_probed) {
            let order = link.order(trip);
            let Dialogue::Servo(servo) = &mut link.dialogue else { continue };
            askable[usize::from(block(&order))] = true;
            match servo.written(&order) {
                None => {}
                Some(Written::Off) => goals[0].add(servo.number, &[0], &mut out),
                Some(Written::On(goal)) => {
                    let [low, high] = goal.to_le_bytes();
                    // at once: no acceleration, no time, no speed are given
                    goals[1].add(servo.number, &[1, 0, low, high, 0, 0, 0, 0], &mut out);
                }
                Some(Written::Goal(goal)) => goals[2].add(servo.number, &goal.to_le_bytes(), &mut out),
            }
        }
        goals.iter_mut().for_each(|group| group.write(&mut out));
        // one question a cycle: two would be answered at once
        let blocks = askable.iter().filter(|is| **is).count() as u64;
        let Some(chosen) = (0..3).filter(|block| askable[*block]).nth((cycle % blocks.max(1)) as usize)
        else {
            return;
        };
        let mut servos = [0; PACKET];
        let mut count = 0;
        let asked_by = out.frames.len() - before + 1;
        for link in links.iter_mut().filter(|link| link.bus() == bus) {
            let is_asked = !link.is_probed && usize::from(block(&link.order(trip))) == chosen;
            link.asked_by = is_asked.then_some(asked_by);
            if let (true, Dialogue::Servo(servo)) = (is_asked && count < servos.len(), &link.dialogue) {
                servos[count] = servo.number;
                count += 1;
            }
        }
        // they answer in this order, and the lowest first on a simulated line
        servos[..count].sort_unstable();
        let (register, bytes) = BLOCKS[chosen];
        let servos = &servos[..count];
        out.push(&Instruction::ReadMany { register: register.into(), count: bytes, servos });
    }
}

/// The registers that are asked for: the two settings, and the state.
const BLOCKS: [(u8, u8); 3] = [
    (feetech::OPERATING_MODE, 1),
    (feetech::ANGLE_LIMITS, 4),
    (feetech::TORQUE_ENABLE, feetech::STATE_BYTES),
];

/// The registers that are asked for with an order.
fn block(order: &Order) -> u8 {
    match order {
        Order::Check(setting) => (*setting).min(1),
        _ => 2,
    }
}

/// The packets that go out.
struct Packets<'a> {
    frames: &'a mut Vec<Frame>,
}

impl Packets<'_> {
    fn push(&mut self, instruction: &Instruction<'_>) {
        let mut packet = [0; LONGEST];
        let written = servo::write(servo::Protocol::One, servo::EVERYBODY, instruction, &mut packet);
        let frame = written.and_then(|length| Frame::packet(servo::EVERYBODY, &packet[..length]));
        debug_assert!(frame.is_some());
        self.frames.extend(frame);
    }
}

/// The same registers of many servos, in one packet or as many as it takes.
struct Group {
    register: u8,
    each: u8,
    data: [u8; PACKET],
    length: usize,
}

/// Bytes of a packet beside those of the servos: head, number, length, instruction, register, bytes of each, checksum.
const AROUND: usize = 8;

impl Group {
    fn new(register: u8, each: u8) -> Self {
        Self { register, each, data: [0; PACKET], length: 0 }
    }

    fn add(&mut self, servo: u8, bytes: &[u8], out: &mut Packets<'_>) {
        if self.length + 1 + bytes.len() > PACKET - AROUND {
            self.write(out);
        }
        self.data[self.length] = servo;
        self.data[self.length + 1..][..bytes.len()].copy_from_slice(bytes);
        self.length += 1 + bytes.len();
    }

    fn write(&mut self, out: &mut Packets<'_>) {
        if self.length > 0 {
            let data = &self.data[..self.length];
            out.push(&Instruction::WriteMany { register: self.register.into(), each: self.each, data });
            self.length = 0;
        }
    }
}
