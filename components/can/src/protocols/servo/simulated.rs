//! Simulated Feetech or Dynamixel servo: a register table and a position loop.

use super::codec::dynamixel;
use super::codec::feetech::{self, OVERHEATED, STATE_BYTES};
use super::maker::Maker;
use crate::frame::{Form, Frame, Id};
use crate::protocols::entries::LoopEntry;
use crate::protocols::simulation::{Motor, Overrides, Simulated, Watchdog};
use crate::protocols::spec::DriveSetup;
use crate::servo::{
    self, EVERYBODY, FastTurn, Instruction, LONGEST, Packet, fast_sum, write_fast_status, write_status,
};

/// Number of registers in the table.
const REGISTERS: usize = 256;
/// Supply voltage, V.
const VOLTAGE: f64 = 7.4;

/// Servo with its registers.
#[derive(Clone, Debug)]
pub(crate) struct Servo {
    number: u8,
    protocol: servo::Protocol,
    gains: LoopEntry,
    registers: [u8; REGISTERS],
    /// Error flags. A Feetech reports them in its state, a Dynamixel in the header of each answer.
    status: u8,
    watchdog: Watchdog,
    /// Watchdog time that cannot be changed, ns.
    fixed_watchdog_ns: Option<u64>,
    /// Position at which the watchdog has stopped the servo, until the watchdog is set again.
    stopped: Option<f64>,
    /// Turn of the servo in the common packet of a fast read, pending until it has answered.
    turn: Option<Turn>,
    /// Torque per unit of the current register, N m; `None` for a servo that reports its load.
    torque_per_unit: Option<f64>,
    motor: Motor,
    watchdog_trips: u64,
}

/// Turn of a servo that waits for the answers of others.
#[derive(Clone, Copy, Debug)]
struct Turn {
    /// Number of servos that answer before it.
    before: usize,
    /// Checksum of their bytes.
    sum: u16,
    register: u16,
    count: u8,
}

impl Servo {
    pub(crate) fn new(setup: &DriveSetup<'_>, maker: Maker, overrides: Overrides) -> Self {
        let entry = setup.entry;
        let is_dynamixel = maker == Maker::Dynamixel;
        let mut servo = Self {
            number: entry.node,
            protocol: maker.layout().protocol,
            gains: setup.gains,
            registers: [0; REGISTERS],
            status: 0,
            watchdog: Watchdog::new(None),
            fixed_watchdog_ns: overrides.watchdog_ns,
            stopped: None,
            turn: None,
            torque_per_unit: entry
                .current_unit
                .zip(entry.torque_constant)
                .map(|(unit, constant)| unit * constant),
            motor: Motor::new(entry.ranges.torque),
            watchdog_trips: 0,
        };
        let steps = entry.homing.as_ref().and_then(|homing| homing.steps).unwrap_or(0);
        if is_dynamixel {
            let mode = match entry.current_limit {
                Some(_) => dynamixel::POSITIONS_BY_CURRENT,
                None => dynamixel::POSITIONS,
            };
            servo.put(dynamixel::OPERATING_MODE.into(), &[mode]);
            servo.put(dynamixel::CURRENT_LIMIT.into(), &2047_u16.to_le_bytes());
            servo.put(dynamixel::HOMING_OFFSET.into(), &steps.to_le_bytes());
            servo.put(dynamixel::POSITION_LIMITS.into(), &(dynamixel::TURN as i32 - 1).to_le_bytes());
        } else {
            let highest = (feetech::TURN as u16 - 1).to_le_bytes();
            servo.put(usize::from(feetech::ANGLE_LIMITS) + 2, &highest);
            let sign = if steps < 0 { 1 << 11 } else { 0 };
            let word = steps.unsigned_abs() as u16 & 0x7ff | sign;
            servo.put(feetech::HOMING_OFFSET.into(), &word.to_le_bytes());
        }
        servo.reset_limits();
        servo
    }

    /// Resets the volatile limits to their power-up values, the full range.
    fn reset_limits(&mut self) {
        if self.is_dynamixel() {
            let highest = self.word(dynamixel::CURRENT_LIMIT.into());
            self.put(dynamixel::GOAL_CURRENT.into(), &highest.to_le_bytes());
        } else {
            self.put(feetech::TORQUE_LIMIT.into(), &1000_u16.to_le_bytes());
        }
    }

    fn word(&self, register: usize) -> u16 {
        u16::from_le_bytes([self.registers[register], self.registers[register + 1]])
    }

    /// Returns the largest torque within its limits, N m.
    fn torque_limit(&self) -> f64 {
        let is_limited =
            self.registers[usize::from(dynamixel::OPERATING_MODE)] == dynamixel::POSITIONS_BY_CURRENT;
        match (self.is_dynamixel(), self.torque_per_unit) {
            (false, _) => f64::from(self.word(feetech::TORQUE_LIMIT.into())) * 1e-3 * self.motor.largest,
            (true, Some(unit)) if is_limited => f64::from(self.word(dynamixel::GOAL_CURRENT.into())) * unit,
            (true, _) => self.motor.largest,
        }
    }

    fn is_dynamixel(&self) -> bool {
        self.protocol == servo::Protocol::Two
    }

    /// Writes bytes into registers. Returns `false` if some of them do not exist.
    fn put(&mut self, register: usize, bytes: &[u8]) -> bool {
        let place = self.registers.get_mut(register..register + bytes.len());
        place.map(|place| place.copy_from_slice(bytes)).is_some()
    }

    /// Returns the register that switches torque on.
    fn switch(&self) -> usize {
        if self.is_dynamixel() { dynamixel::TORQUE_ENABLE.into() } else { feetech::TORQUE_ENABLE.into() }
    }

    fn is_switched_on(&self) -> bool {
        self.registers[self.switch()] == 1
    }

    fn take(&mut self, frame: &Frame, now_ns: u64) -> Option<Frame> {
        if frame.form != Form::Packet {
            return None;
        }
        let mut packet = Packet::default();
        let (protocol, servo, instruction) = packet.instruction(frame.data()).ok()?;
        if protocol != self.protocol {
            return None;
        }
        // a packet to any servo feeds the watchdog and cancels a pending turn in a common packet
        self.watchdog.fed_ns = now_ns;
        self.turn = None;
        let is_meant = servo == self.number;
        match instruction {
            // a Dynamixel reports its model and firmware version
            Instruction::Ping if is_meant || (servo == EVERYBODY && self.is_dynamixel()) => {
                self.answer(0, if self.is_dynamixel() { 3 } else { 0 })
            }
            Instruction::Read { register, count } if is_meant => self.answer(register, count),
            Instruction::ReadMany { register, count, servos } if servos.contains(&self.number) => {
                self.answer(register, count)
            }
            Instruction::FastReadMany { register, count, servos } => {
                match servos.iter().position(|servo| *servo == self.number)? {
                    0 => self.share(FastTurn::First { servos: servos.len() }, register, count),
                    before => {
                        self.turn = Some(Turn { before, sum: 0, register, count });
                        None
                    }
                }
            }
            Instruction::Write { register, data } if is_meant || servo == EVERYBODY => {
                self.write(register, data);
                if is_meant { self.answer(0, 0) } else { None }
            }
            Instruction::WriteMany { register, each, data } => {
                let mine = data.chunks(usize::from(each) + 1).find(|chunk| chunk[0] == self.number);
                if let Some([_, data @ ..]) = mine {
                    self.write(register, data);
                }
                None
            }
            _ => None,
        }
    }

    /// Observes the answer of another servo, and adds the servo's own share to a common packet when its turn
    /// comes.
    fn take_turn(&mut self, frame: &Frame) -> Option<Frame> {
        if frame.form != Form::Packet || frame.id != Id::Standard(EVERYBODY.into()) {
            return None;
        }
        let turn = self.turn.as_mut()?;
        (turn.before, turn.sum) = (turn.before - 1, fast_sum(turn.sum, frame.data()));
        let Turn { before: 0, sum, register, count } = *turn else { return None };
        self.turn = None;
        self.share(FastTurn::After { sum }, register, count)
    }

    fn share(&mut self, turn: FastTurn, register: u16, count: u8) -> Option<Frame> {
        let (mut share, number, error) = ([0; LONGEST], self.number, self.status);
        let data = self.read(register, count)?;
        let length = write_fast_status(turn, number, error, data, &mut share)?;
        Frame::packet(EVERYBODY, &share[..length])
    }

    fn write(&mut self, register: u16, data: &[u8]) {
        let register = usize::from(register);
        let written = register..register + data.len();
        if self.is_dynamixel() {
            let watchdog = usize::from(dynamixel::BUS_WATCHDOG);
            // goals are read-only after the watchdog has stopped the servo
            if self.stopped.is_some() && written.contains(&dynamixel::GOAL_POSITION.into()) {
                return;
            }
            // clamped to the limit stored in the servo
            let goal_current = usize::from(dynamixel::GOAL_CURRENT);
            let highest = self.word(dynamixel::CURRENT_LIMIT.into());
            if register == goal_current && data.len() == 2 && u16::from_le_bytes([data[0], data[1]]) > highest
            {
                return;
            }
            if !self.put(register, data) {
                return;
            }
            if written.contains(&watchdog) {
                let unit_ns = dynamixel::WATCHDOG_UNIT_NS;
                if let Some(fixed_ns) = self.fixed_watchdog_ns {
                    self.registers[watchdog] = (fixed_ns / unit_ns) as u8;
                }
                let after_ns = u64::from(self.registers[watchdog]) * unit_ns;
                self.watchdog.after_ns = Some(after_ns).filter(|ns| *ns > 0);
                self.stopped = None;
            }
        } else {
            self.put(register, data);
        }
        // switching torque on again clears the error that had switched it off
        if written.contains(&self.switch()) && !self.is_switched_on() {
            self.status = 0;
        }
    }

    fn answer(&mut self, register: u16, count: u8) -> Option<Frame> {
        let (mut packet, number, error, protocol) = ([0; LONGEST], self.number, self.status, self.protocol);
        let length = write_status(protocol, number, error, self.read(register, count)?, &mut packet)?;
        Frame::packet(number, &packet[..length])
    }

    /// Returns register bytes, including the current state.
    fn read(&mut self, register: u16, count: u8) -> Option<&[u8]> {
        let motor = &self.motor;
        let (position, velocity, temperature) = (motor.position, motor.velocity, motor.temperature);
        let load = motor.torque / motor.largest;
        if self.is_dynamixel() {
            let load = match self.torque_per_unit {
                Some(unit) => motor.torque / unit,
                None => load * 1e3,
            } as i16;
            let state = dynamixel::State { position, velocity, load, voltage: VOLTAGE, temperature };
            let place = self.registers[usize::from(dynamixel::STATE)..]
                .first_chunk_mut::<{ dynamixel::STATE_BYTES as usize }>()?;
            state.encode(place);
        } else {
            let state = feetech::State {
                is_enabled: self.is_switched_on(),
                position,
                velocity,
                load,
                voltage: VOLTAGE,
                temperature,
                status: self.status,
            };
            let switch = self.switch();
            let place = self.registers[switch..].first_chunk_mut::<{ STATE_BYTES as usize }>()?;
            state.encode(place);
        }
        self.registers.get(usize::from(register)..usize::from(register) + usize::from(count))
    }

    /// Returns the goal position, rad.
    fn goal(&self) -> f64 {
        if self.is_dynamixel() {
            let place = usize::from(dynamixel::GOAL_POSITION);
            let bytes = self.registers[place..].first_chunk().copied().unwrap_or_default();
            return dynamixel::position(i32::from_le_bytes(bytes));
        }
        feetech::position(self.word(feetech::GOAL_POSITION.into()))
    }
}

impl Simulated for Servo {
    fn ids(&self) -> Vec<Id> {
        vec![Id::Standard(self.number.into()), Id::Standard(EVERYBODY.into())]
    }

    fn is_enabled(&self) -> bool {
        self.is_switched_on() && self.stopped.is_none()
    }

    fn cut_power(&mut self) {
        let switch = self.switch();
        self.registers[switch..].fill(0);
        self.reset_limits();
        (self.status, self.stopped, self.watchdog) = (0, None, Watchdog::new(None));
    }

    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        if self.stopped.is_none() && self.watchdog.has_expired(now_ns) {
            self.registers[usize::from(dynamixel::BUS_WATCHDOG)] = dynamixel::WATCHDOG_EXPIRED;
            self.stopped = Some(position);
            self.watchdog_trips += 1;
        }
        if self.is_switched_on() && self.motor.is_too_hot() {
            self.status |= if self.is_dynamixel() { dynamixel::ALERT } else { OVERHEATED };
            let switch = self.switch();
            self.registers[switch] = 0;
        }
        let LoopEntry { kp, kd } = self.gains;
        let desired = kp * (self.stopped.unwrap_or_else(|| self.goal()) - position) - kd * velocity;
        self.motor.limit(self.torque_limit());
        self.motor.apply(self.is_switched_on().then_some(desired))
    }

    fn motor(&self) -> &Motor {
        &self.motor
    }

    fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    fn watchdog_trips(&self) -> u64 {
        self.watchdog_trips
    }

    fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        self.take(frame, now_ns).into_iter().for_each(answer);
    }

    fn observe(&mut self, frame: &Frame, answer: &mut dyn FnMut(Frame)) {
        self.take_turn(frame).into_iter().for_each(answer);
    }
}
