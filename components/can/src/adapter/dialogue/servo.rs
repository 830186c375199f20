//! Dialogue with servos on a serial line. One packet writes the goals of all servos on a line, one packet
//! queries all of them, and they answer one after the other.

use super::motion::Motion;
use super::order::Order;
use super::response::Response;
use crate::adapter::WrongSetting;
use crate::dynamixel;
use crate::feetech;
use crate::frame::{DecodeError, Form, Frame, Id};
use crate::mit::{Fault, Feedback, Ranges, State};
use crate::servo::{self, Packet, Status};
use crate::table::{Protocol, Table};

#[derive(Clone, Debug)]
pub(in crate::adapter) struct Servo {
    pub(in crate::adapter) number: u8,
    pub(in crate::adapter) maker: Maker,
    /// Watchdog time, ns; 0 for off.
    watchdog_ns: u64,
    ranges: Ranges,
    /// Full torque, of which loads are shares, N m.
    torque: f64,
    /// Required homing offset, steps.
    homing_offset: Option<i32>,
    /// Current limit in units of its register; `None` keeps the servo's setting.
    current_limit: Option<u16>,
    /// Torque per unit of the current register, N m.
    torque_per_unit: Option<f64>,
    motion: Motion,
}

/// Manufacturer of a servo, which determines its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::adapter) enum Maker {
    Feetech,
    Dynamixel,
}

/// Setting of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Setting {
    Mode,
    Goals,
    Watchdog,
    HomingOffset,
    CurrentLimit,
}

/// Registers written to all servos of a line together: the first register, and the bytes per servo.
pub(in crate::adapter) type Registers = (u16, u8);

impl Maker {
    pub(in crate::adapter) fn protocol(self) -> servo::Protocol {
        match self {
            Self::Feetech => servo::Protocol::One,
            Self::Dynamixel => servo::Protocol::Two,
        }
    }

    /// Registers written in a cycle, in this order.
    pub(in crate::adapter) fn written(self) -> &'static [Registers] {
        match self {
            Self::Feetech => &[
                (feetech::TORQUE_ENABLE as u16, 1),
                (feetech::TORQUE_ENABLE as u16, feetech::ENABLE_BYTES),
                (feetech::GOAL_POSITION as u16, 2),
                (feetech::TORQUE_LIMIT as u16, 2),
            ],
            Self::Dynamixel => &[
                (dynamixel::TORQUE_ENABLE, 1),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::GOAL_POSITION, 4),
                (dynamixel::TORQUE_ENABLE, 1),
                (dynamixel::GOAL_CURRENT, 2),
            ],
        }
    }

    /// Registers read from the servo: the settings one after the other, and the state last.
    pub(in crate::adapter) fn asked(self) -> &'static [Registers] {
        match self {
            Self::Feetech => &[
                (feetech::OPERATING_MODE as u16, 1),
                (feetech::ANGLE_LIMITS as u16, 4),
                (feetech::HOMING_OFFSET as u16, 2),
                (feetech::TORQUE_LIMIT as u16, 2),
                (feetech::TORQUE_ENABLE as u16, feetech::STATE_BYTES),
            ],
            Self::Dynamixel => &[
                (dynamixel::OPERATING_MODE, 1),
                (dynamixel::POSITION_LIMITS, 8),
                (dynamixel::BUS_WATCHDOG, 1),
                (dynamixel::HOMING_OFFSET, 4),
                (dynamixel::GOAL_CURRENT, 2),
                (dynamixel::STATE, dynamixel::STATE_BYTES),
            ],
        }
    }

    /// Setting in the read block with this index; `None` for the state.
    fn setting(self, block: usize) -> Option<Setting> {
        let settings: &[Setting] = match self {
            Self::Feetech => &[Setting::Mode, Setting::Goals, Setting::HomingOffset, Setting::CurrentLimit],
            Self::Dynamixel => &[
                Setting::Mode,
                Setting::Goals,
                Setting::Watchdog,
                Setting::HomingOffset,
                Setting::CurrentLimit,
            ],
        };
        settings.get(block).copied()
    }

    /// Highest position: the last step of a turn.
    fn highest(self) -> f64 {
        match self {
            Self::Feetech => feetech::position(feetech::TURN as u16 - 1),
            Self::Dynamixel => dynamixel::position(dynamixel::TURN as i32 - 1),
        }
    }
}

impl Servo {
    pub(super) fn new(table: &Table, index: usize) -> Self {
        let entry = &table.drives[index];
        let is_dynamixel = entry.protocol == Protocol::Dynamixel;
        Self {
            number: entry.node,
            maker: if is_dynamixel { Maker::Dynamixel } else { Maker::Feetech },
            watchdog_ns: entry.watchdog.ns,
            ranges: table.ranges(index),
            torque: entry.ranges.torque,
            homing_offset: entry.homing.as_ref().and_then(|homing| homing.steps),
            current_limit: entry.current_register().map(|number| number as u16),
            torque_per_unit: entry
                .current_unit
                .zip(entry.torque_constant)
                .map(|(unit, constant)| unit * constant),
            motion: Motion::default(),
        }
    }

    /// Number of checks: operating mode, goal limits, and the optional settings of the table.
    pub(super) fn checks(&self) -> u8 {
        self.blocks().count() as u8 - 1
    }

    /// Indices of the blocks to read among the manufacturer's registers: the settings, and the state last.
    fn blocks(&self) -> impl Iterator<Item = usize> {
        let is_asked = |block: &usize| match self.maker.setting(*block) {
            Some(Setting::HomingOffset) => self.homing_offset.is_some(),
            Some(Setting::CurrentLimit) => self.current_limit.is_some(),
            Some(Setting::Mode | Setting::Goals | Setting::Watchdog) | None => true,
        };
        (0..self.maker.asked().len()).filter(is_asked)
    }

    /// Index of the block to read with an order.
    pub(in crate::adapter) fn block(&self, order: &Order) -> usize {
        let state = self.maker.asked().len() - 1;
        match order {
            Order::Check(setting) => self.blocks().nth((*setting).into()).unwrap_or(state),
            _ => state,
        }
    }

    /// A Feetech reports whether its torque is on, a Dynamixel does not.
    pub(super) fn tells_its_state(&self) -> bool {
        self.maker == Maker::Feetech
    }

    pub(super) fn is_from(&self, frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(self.number.into())
    }

    /// Watchdog time in units of its register.
    fn watchdog(&self) -> u8 {
        (self.watchdog_ns / dynamixel::WATCHDOG_UNIT_NS) as u8
    }

    /// Writes the registers that an order requires: passes `put` the index of the block among the
    /// manufacturer's registers, and the bytes.
    pub(in crate::adapter) fn write(&mut self, order: &Order, put: &mut dyn FnMut(usize, &[u8])) {
        self.motion.begin(order);
        let goal = match order {
            Order::Check(_) => {
                match (self.maker.setting(self.block(order)), self.current_limit) {
                    (Some(Setting::Watchdog), _) => {
                        // a watchdog that has stopped the servo is cleared first
                        put(1, &[0]);
                        put(2, &[self.watchdog()]);
                    }
                    (Some(Setting::CurrentLimit), Some(limit)) => {
                        put(self.maker.written().len() - 1, &limit.to_le_bytes());
                    }
                    _ => {}
                }
                return;
            }
            Order::Disable | Order::Rest | Order::Home => return put(0, &[0]),
            Order::Enable => self.motion.position,
            Order::Follow(command) => self.motion.target(command),
        };
        // goal and torque together, so that the servo does not run to an old goal
        let is_begin = *order == Order::Enable;
        match self.maker {
            Maker::Feetech => {
                let [low, high] = feetech::step(goal).to_le_bytes();
                match is_begin {
                    // immediate motion: acceleration, time and speed are zero
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
            Some(setting) => {
                self.check(self.block(&Order::Check(setting)), status.data).map(Response::Setting)
            }
            None => self.state(&status).map(Response::Feedback),
        }
    }

    fn check(&self, block: usize, data: &[u8]) -> Result<Option<WrongSetting>, DecodeError> {
        use Setting::{CurrentLimit, Goals, HomingOffset, Mode, Watchdog};
        let word = |bytes: [u8; 2]| u16::from_le_bytes(bytes);
        let ends = match (self.maker, self.maker.setting(block), data) {
            (_, Some(Mode), [mode]) => return Ok(self.wrong_mode(*mode)),
            (_, Some(Watchdog), [units]) => {
                let found_ns = u64::from(*units) * dynamixel::WATCHDOG_UNIT_NS;
                let wrong = WrongSetting::Watchdog {
                    found: Some(found_ns).filter(|ns| *ns > 0),
                    expected: self.watchdog_ns,
                };
                return Ok((found_ns != self.watchdog_ns).then_some(wrong));
            }
            (_, Some(CurrentLimit), [a, b]) => {
                let (found, expected) = (word([*a, *b]), self.current_limit.unwrap_or_default());
                let wrong = WrongSetting::CurrentLimit { found: found.into(), expected: expected.into() };
                return Ok((found != expected).then_some(wrong));
            }
            (Maker::Feetech, Some(HomingOffset), [a, b]) => {
                return Ok(self.wrong_offset(feetech::homing_offset(word([*a, *b]))));
            }
            (Maker::Dynamixel, Some(HomingOffset), [a, b, c, d]) => {
                return Ok(self.wrong_offset(i32::from_le_bytes([*a, *b, *c, *d])));
            }
            (Maker::Feetech, Some(Goals), [a, b, c, d]) => {
                [[*a, *b], [*c, *d]].map(|bytes| feetech::position(word(bytes)))
            }
            (Maker::Dynamixel, Some(Goals), [a, b, c, d, e, f, g, h]) => {
                // the highest comes first
                [[*e, *f, *g, *h], [*a, *b, *c, *d]].map(|long| dynamixel::position(i32::from_le_bytes(long)))
            }
            (_, _, data) => {
                let expected = self.maker.asked()[block].1.into();
                return Err(DecodeError::Length { found: data.len(), expected });
            }
        };
        let needed = self.ranges.position.max.min(self.maker.highest());
        // within one step: the upper end of a turn is one step short
        let covers = ends[0] <= 2e-3 - needed && ends[1] >= needed - 2e-3;
        Ok((!covers).then_some(WrongSetting::Goals { found: ends, expected: self.ranges.position.max }))
    }

    /// Operating mode in which the servo does not follow positions, or does not apply its current limit.
    fn wrong_mode(&self, found: u8) -> Option<WrongSetting> {
        let expected = match (self.maker, self.current_limit) {
            (Maker::Feetech, _) => feetech::POSITIONS,
            (Maker::Dynamixel, None) if found == dynamixel::POSITIONS_BY_CURRENT => return None,
            (Maker::Dynamixel, None) => dynamixel::POSITIONS,
            (Maker::Dynamixel, Some(_)) => dynamixel::POSITIONS_BY_CURRENT,
        };
        (found != expected).then_some(WrongSetting::OperatingMode { found, expected })
    }

    fn wrong_offset(&self, found: i32) -> Option<WrongSetting> {
        let expected = self.homing_offset.unwrap_or_default();
        (found != expected).then_some(WrongSetting::HomingOffset { found, expected })
    }

    pub(super) fn accept(&mut self, feedback: &Feedback) {
        (self.motion.position, self.motion.velocity) = (feedback.position, feedback.velocity);
    }

    fn state(&self, status: &Status<'_>) -> Result<Feedback, DecodeError> {
        let most = self.torque;
        let feedback = match self.maker {
            Maker::Feetech => {
                let reported = feetech::State::decode(status.data)?;
                let reported = feetech::State { status: reported.status | status.error, ..reported };
                Feedback {
                    position: reported.position,
                    velocity: reported.velocity,
                    torque: reported.load * most,
                    temperature: Some(reported.temperature),
                    voltage: Some(reported.voltage),
                    state: match (reported.fault(), reported.is_enabled) {
                        (Some(fault), _) => State::Fault(fault),
                        (None, true) => State::Enabled,
                        (None, false) => State::Disabled,
                    },
                }
            }
            Maker::Dynamixel => {
                let reported = dynamixel::State::decode(status.data)?;
                let is_well = status.error & dynamixel::ALERT == 0;
                Feedback {
                    position: reported.position,
                    velocity: reported.velocity,
                    // the register holds the current or the load
                    torque: f64::from(reported.load) * self.torque_per_unit.unwrap_or(1e-3 * most),
                    temperature: Some(reported.temperature),
                    voltage: Some(reported.voltage),
                    state: if is_well {
                        State::Unknown
                    } else {
                        State::Fault(Fault::Other(status.error.into()))
                    },
                }
            }
        };
        Ok(feedback)
    }
}
