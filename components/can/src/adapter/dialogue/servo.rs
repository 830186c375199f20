//! The dialogue with servos on a serial line: one packet writes the goals of all servos of a line, one asks all of them, and they
//! answer one after the other.

use super::{Dialogue, Response, Motion, Order};
use crate::adapter::common_answer::CommonAnswer;
use crate::adapter::{Link, OnTrip, WrongSetting};
use crate::dynamixel;
use crate::feetech;
use crate::frame::{DecodeError, Form, Frame, Id};
use crate::mit::{Fault, Feedback, Ranges, State};
use crate::servo::{self, Instruction, LONGEST, Packet, Status};
use crate::table::{Protocol, Table};

/// Bytes of the longest packet that goes out.
const PACKET: usize = 64;

#[derive(Clone, Debug)]
pub(in crate::adapter) struct Servo {
    number: u8,
    maker: Maker,
    /// Time of the watchdog, ns; 0 for off.
    watchdog_ns: u64,
    ranges: Ranges,
    motion: Motion,
}

/// The maker of a servo, whose registers it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Maker {
    Feetech,
    Dynamixel,
}

/// Registers that are written to all servos of a line together: the first one, and bytes of each.
type Registers = (u16, u8);

impl Maker {
    fn protocol(self) -> servo::Protocol {
        match self {
            Self::Feetech => servo::Protocol::One,
            Self::Dynamixel => servo::Protocol::Two,
        }
    }

    /// The registers that are written in a cycle, in this order.
    fn written(self) -> &'static [Registers] {
        match self {
            Self::Feetech => &[
                (feetech::TORQUE_ENABLE as u16, 1),
                (feetech::TORQUE_ENABLE as u16, feetech::ENABLE_BYTES),
                (feetech::GOAL_POSITION as u16, 2),
            ],
            Self::Dynamixel => &[
                (dynamixel::TORQUE_ENABLE, 1),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::GOAL_POSITION, 4),
                (dynamixel::TORQUE_ENABLE, 1),
            ],
        }
    }

    /// The registers that are asked for: the settings, one after the other, and the state at last.
    fn asked(self) -> &'static [Registers] {
        match self {
            Self::Feetech => &[
                (feetech::OPERATING_MODE as u16, 1),
                (feetech::ANGLE_LIMITS as u16, 4),
                (feetech::TORQUE_ENABLE as u16, feetech::STATE_BYTES),
            ],
            Self::Dynamixel => &[
                (dynamixel::OPERATING_MODE, 1),
                (dynamixel::POSITION_LIMITS, 8),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::STATE, dynamixel::STATE_BYTES),
            ],
        }
    }

    /// The registers that are asked for with an order.
    fn block(self, order: &Order) -> usize {
        let state = self.asked().len() - 1;
        match order {
            Order::Check(setting) => usize::from(*setting).min(state),
            _ => state,
        }
    }

    /// The highest position, that of the last step of a turn.
    fn highest(self) -> f64 {
        match self {
            Self::Feetech => feetech::position(feetech::TURN as u16 - 1),
            Self::Dynamixel => dynamixel::position(dynamixel::TURN as i32 - 1),
        }
    }
}

/// The most registers that are written, and the most that are asked for.
const MOST: usize = 5;

impl Servo {
    pub(super) fn new(table: &Table, index: usize) -> Self {
        let entry = &table.drives[index];
        let is_dynamixel = entry.protocol == Protocol::Dynamixel;
        Self {
            number: entry.node,
            maker: if is_dynamixel { Maker::Dynamixel } else { Maker::Feetech },
            watchdog_ns: entry.watchdog.ns,
            ranges: table.ranges(index),
            motion: Motion::default(),
        }
    }

    /// Operating mode, limits of goals, and the watchdog, where there is one.
    pub(super) fn checks(&self) -> u8 {
        self.maker.asked().len() as u8 - 1
    }

    /// A Dynamixel does not tell whether its torque is on, a Feetech does.
    pub(super) fn tells_its_state(&self) -> bool {
        self.maker == Maker::Feetech
    }

    pub(super) fn is_from(&self, frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(self.number.into())
    }

    /// The time of the watchdog as its register has it.
    fn watchdog(&self) -> u8 {
        (self.watchdog_ns / dynamixel::WATCHDOG_UNIT_NS) as u8
    }

    /// Writes what an order needs: the index of the registers among those of the maker, and the bytes.
    fn write(&mut self, order: &Order, put: &mut dyn FnMut(usize, &[u8])) {
        self.motion.begin(order);
        let goal = match order {
            Order::Check(setting) => {
                if self.maker == Maker::Dynamixel && *setting == 2 {
                    // one that has stopped the servo is cleared first
                    put(1, &[0]);
                    put(2, &[self.watchdog()]);
                }
                return;
            }
            Order::Disable | Order::Rest => return put(0, &[0]),
            Order::Enable => self.motion.position,
            Order::Follow(command) => self.motion.target(command),
        };
        // goal and torque together: it must not run to a goal of before
        let is_begin = *order == Order::Enable;
        match self.maker {
            Maker::Feetech => {
                let [low, high] = feetech::step(goal).to_le_bytes();
                match is_begin {
                    // at once: no acceleration, no time, no speed are given
                    true => put(1, &[1, 0, low, high, 0, 0, 0, 0]),
                    false => put(2, &[low, high]),
                }
            }
            Maker::Dynamixel => {
                put(3, &dynamixel::step(goal).to_le_bytes());
                if is_begin {
                    put(4, &[1]);
                }
            }
        }
    }

    pub(super) fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        let mut packet = Packet::default();
        let status = packet.status(frame.data())?;
        if status.servo != self.number {
            return Err(DecodeError::Device { found: status.servo, expected: self.number });
        }
        if status.protocol != self.maker.protocol() {
            return Err(DecodeError::Field { field: "the protocol", found: u32::from(frame.data()[2]) });
        }
        match checking {
            Some(setting) => self.check(setting, status.data).map(Response::Setting),
            None => self.state(&status).map(Response::Feedback),
        }
    }

    fn check(&self, setting: u8, data: &[u8]) -> Result<Option<WrongSetting>, DecodeError> {
        let ends = match (self.maker, setting, data) {
            (Maker::Feetech, 0, [mode]) => {
                let wrong = WrongSetting::OperatingMode { found: *mode, expected: 0 };
                return Ok((*mode != 0).then_some(wrong));
            }
            (Maker::Dynamixel, 0, [mode]) => {
                let wrong = WrongSetting::OperatingMode { found: *mode, expected: dynamixel::POSITIONS };
                let is_right = matches!(*mode, dynamixel::POSITIONS | dynamixel::POSITIONS_BY_CURRENT);
                return Ok((!is_right).then_some(wrong));
            }
            (Maker::Dynamixel, 2, [units]) => {
                let found_ns = u64::from(*units) * dynamixel::WATCHDOG_UNIT_NS;
                let wrong = WrongSetting::Watchdog {
                    found: Some(found_ns).filter(|ns| *ns > 0),
                    expected: self.watchdog_ns,
                };
                return Ok((found_ns != self.watchdog_ns).then_some(wrong));
            }
            (Maker::Feetech, 1, [a, b, c, d]) => {
                [[*a, *b], [*c, *d]].map(|word| feetech::position(u16::from_le_bytes(word)))
            }
            (Maker::Dynamixel, 1, [a, b, c, d, e, f, g, h]) => {
                // the highest first
                [[*e, *f, *g, *h], [*a, *b, *c, *d]].map(|long| dynamixel::position(i32::from_le_bytes(long)))
            }
            (_, _, data) => {
                let expected = self.maker.asked()[usize::from(setting)].1.into();
                return Err(DecodeError::Length { found: data.len(), expected });
            }
        };
        let needed = self.ranges.position.max.min(self.maker.highest());
        // to a step, and the range of a turn is a step shorter above
        let covers = ends[0] <= 2e-3 - needed && ends[1] >= needed - 2e-3;
        Ok((!covers).then_some(WrongSetting::Goals { found: ends, expected: self.ranges.position.max }))
    }

    fn state(&mut self, status: &Status<'_>) -> Result<Feedback, DecodeError> {
        let most = self.ranges.torque.max;
        let feedback = match self.maker {
            Maker::Feetech => {
                let told = feetech::State::decode(status.data)?;
                let told = feetech::State { status: told.status | status.error, ..told };
                Feedback {
                    position: told.position,
                    velocity: told.velocity,
                    torque: told.load * most,
                    temperature: Some(told.temperature),
                    voltage: Some(told.voltage),
                    state: match (told.fault(), told.is_enabled) {
                        (Some(fault), _) => State::Fault(fault),
                        (None, true) => State::Enabled,
                        (None, false) => State::Disabled,
                    },
                }
            }
            Maker::Dynamixel => {
                let told = dynamixel::State::decode(status.data)?;
                let is_well = status.error & dynamixel::ALERT == 0;
                Feedback {
                    position: told.position,
                    velocity: told.velocity,
                    torque: f64::from(told.load) * 1e-3 * most,
                    temperature: Some(told.temperature),
                    voltage: Some(told.voltage),
                    state: if is_well {
                        State::Unknown
                    } else {
                        State::Fault(Fault::Other(status.error.into()))
                    },
                }
            }
        };
        (self.motion.position, self.motion.velocity) = (feedback.position, feedback.velocity);
        Ok(feedback)
    }

    /// Writes the packets of a cycle for all servos of a line, and notes after how many frames each has been asked. They answer
    /// together where they can, unless one was silent: those behind it would be, too.
    pub(in crate::adapter) fn write_line(
        links: &mut [Link],
        common: Option<&mut CommonAnswer>,
        bus: usize,
        (trip, cycle): (Option<OnTrip>, u64),
        frames: &mut Vec<Frame>,
    ) {
        let before = frames.len();
        let first = links.iter().find_map(|link| match &link.dialogue {
            Dialogue::Servo(servo) if link.bus() == bus => Some(servo.maker),
            _ => None,
        });
        // all servos of a line are of one maker
        let Some(maker) = first else { return };
        let mut out = Packets { protocol: maker.protocol(), frames };
        let mut groups = [const { Group::new(0, 0) }; MOST];
        for (group, (register, each)) in groups.iter_mut().zip(maker.written()) {
            *group = Group::new(*register, *each);
        }
        let mut askable = [false; MOST];
        for link in links.iter_mut().filter(|link| link.bus() == bus && !link.is_probed) {
            let order = link.order(trip);
            let Dialogue::Servo(servo) = &mut link.dialogue else { continue };
            askable[maker.block(&order)] = true;
            let number = servo.number;
            servo.write(&order, &mut |group, bytes| groups[group].add(number, bytes, &mut out));
        }
        groups.iter_mut().for_each(|group| group.write(&mut out));
        // one question a cycle: two would be answered at once
        let blocks = askable.iter().filter(|is| **is).count() as u64;
        let Some(chosen) = (0..MOST).filter(|block| askable[*block]).nth((cycle % blocks.max(1)) as usize)
        else {
            return;
        };
        let mut servos = [0; PACKET];
        let mut count = 0;
        let asked_by = out.frames.len() - before + 1;
        for link in links.iter_mut().filter(|link| link.bus() == bus) {
            let is_asked = !link.is_probed && maker.block(&link.order(trip)) == chosen;
            link.asked_by = is_asked.then_some(asked_by);
            if let (true, Dialogue::Servo(servo)) = (is_asked && count < servos.len(), &link.dialogue) {
                servos[count] = servo.number;
                count += 1;
            }
        }
        // they answer in this order, and the lowest first on a simulated line
        servos[..count].sort_unstable();
        let (register, bytes) = maker.asked()[chosen];
        let servos = &servos[..count];
        let is_whole = links.iter().all(|link| link.bus() != bus || link.silent() == 0 && !link.is_probed);
        let together = is_whole && common.is_some_and(|common| common.ask(bytes));
        out.push(&match together {
            true => Instruction::FastReadMany { register, count: bytes, servos },
            false => Instruction::ReadMany { register, count: bytes, servos },
        });
    }
}

/// The packets that go out.
struct Packets<'a> {
    protocol: servo::Protocol,
    frames: &'a mut Vec<Frame>,
}

impl Packets<'_> {
    fn push(&mut self, instruction: &Instruction<'_>) {
        let mut packet = [0; LONGEST];
        let written = servo::write(self.protocol, servo::EVERYBODY, instruction, &mut packet);
        let frame = written.and_then(|length| Frame::packet(servo::EVERYBODY, &packet[..length]));
        debug_assert!(frame.is_some());
        self.frames.extend(frame);
    }
}

/// The same registers of many servos, in one packet or as many as it takes.
struct Group {
    register: u16,
    each: u8,
    data: [u8; PACKET],
    length: usize,
}

/// Bytes of a packet beside those of the servos, and those that keep data and heads apart: of protocol 2, which has more.
const AROUND: usize = 20;

impl Group {
    const fn new(register: u16, each: u8) -> Self {
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
            out.push(&Instruction::WriteMany { register: self.register, each: self.each, data });
            self.length = 0;
        }
    }
}
