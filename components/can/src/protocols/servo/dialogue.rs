//! Dialogue with servos on a serial line. One packet writes the goals of all servos on a line, one packet
//! queries all servos, and they answer one after the other.

use super::codec::{dynamixel, feetech};
use super::maker::{Maker, Setting};
use crate::drive::{Fault, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame, Id};
use crate::protocols::dialogue::{Dialogue, Layout, Member, Motion, Order, Response};
use crate::protocols::setting::WrongSetting;
use crate::protocols::spec::DriveSetup;
use crate::servo::{Packet, Status};

#[derive(Clone, Debug)]
pub(crate) struct Servo {
    number: u8,
    maker: Maker,
    /// Watchdog time, ns; 0 for off.
    watchdog_ns: u64,
    ranges: Ranges,
    /// Full torque, N m, the base of loads.
    torque: f64,
    /// Required homing offset, steps.
    homing_offset: Option<i32>,
    /// Current limit in units of its register; `None` keeps the servo's setting.
    current_limit: Option<u16>,
    /// Torque per unit of the current register, N m.
    torque_per_unit: Option<f64>,
    motion: Motion,
}

impl Servo {
    /// Creates a dialogue. `current_limit` is in units of the servo's register.
    pub(crate) fn new(setup: &DriveSetup<'_>, maker: Maker, current_limit: Option<u16>) -> Self {
        let entry = setup.entry;
        Self {
            number: entry.node,
            maker,
            watchdog_ns: entry.watchdog.ns,
            ranges: setup.ranges,
            torque: entry.ranges.torque,
            homing_offset: entry.homing.as_ref().and_then(|homing| homing.steps),
            current_limit,
            torque_per_unit: entry
                .current_unit
                .zip(entry.torque_constant)
                .map(|(unit, constant)| unit * constant),
            motion: Motion::default(),
        }
    }

    /// Returns the indices of the blocks to read among the manufacturer's registers: first the settings, then
    /// the state.
    fn blocks(&self) -> impl Iterator<Item = usize> {
        let is_asked = |block: &usize| match self.maker.setting(*block) {
            Some(Setting::HomingOffset) => self.homing_offset.is_some(),
            Some(Setting::CurrentLimit) => self.current_limit.is_some(),
            Some(Setting::Mode | Setting::Goals | Setting::Watchdog) | None => true,
        };
        (0..self.maker.layout().read.len()).filter(is_asked)
    }

    /// Returns the watchdog time in units of its register.
    fn watchdog(&self) -> u8 {
        (self.watchdog_ns / dynamixel::WATCHDOG_UNIT_NS) as u8
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
                let expected = self.maker.layout().read[block].1.into();
                return Err(DecodeError::Length { found: data.len(), expected });
            }
        };
        let needed = self.ranges.position.max.min(self.maker.highest());
        // tolerance of one step, because the upper end of a turn is one step short
        let covers = ends[0] <= 2e-3 - needed && ends[1] >= needed - 2e-3;
        Ok((!covers).then_some(WrongSetting::Goals { found: ends, expected: self.ranges.position.max }))
    }

    /// Returns the mismatch if the servo does not follow positions in this operating mode, or does not apply
    /// its current limit.
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

impl Member for Servo {
    fn block(&self, order: &Order) -> usize {
        let state = self.maker.layout().read.len() - 1;
        match order {
            Order::Check(setting) => self.blocks().nth((*setting).into()).unwrap_or(state),
            _ => state,
        }
    }

    fn put(&mut self, order: &Order, put: &mut dyn FnMut(usize, &[u8])) {
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
                        put(self.maker.layout().written.len() - 1, &limit.to_le_bytes());
                    }
                    _ => {}
                }
                return;
            }
            Order::Disable | Order::Rest | Order::Home => return put(0, &[0]),
            Order::Enable => self.motion.position,
            Order::Follow(command) => self.motion.target(command),
        };
        // goal and torque are written together: otherwise the servo would move to an old goal
        let is_begin = *order == Order::Enable;
        match self.maker {
            Maker::Feetech => {
                let [low, high] = feetech::step(goal).to_le_bytes();
                match is_begin {
                    // acceleration, time and speed are zero for immediate motion
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

    fn number(&self) -> u8 {
        self.number
    }

    fn layout(&self) -> &'static Layout {
        self.maker.layout()
    }
}

impl Dialogue for Servo {
    fn checks(&self) -> u8 {
        self.blocks().count() as u8 - 1
    }

    fn reports_state(&self) -> bool {
        self.maker == Maker::Feetech
    }

    fn is_from(&self, frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(self.number.into())
    }

    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        let mut packet = Packet::default();
        let status = packet.status(frame.data())?;
        if status.servo != self.number {
            return Err(DecodeError::Device { found: status.servo, expected: self.number });
        }
        if status.protocol != self.maker.layout().protocol {
            return Err(DecodeError::Field { field: "the protocol", found: u32::from(frame.data()[2]) });
        }
        match checking {
            Some(setting) => {
                self.check(self.block(&Order::Check(setting)), status.data).map(Response::Setting)
            }
            None => self.state(&status).map(Response::Feedback),
        }
    }

    fn accept(&mut self, feedback: &Feedback) {
        (self.motion.position, self.motion.velocity) = (feedback.position, feedback.velocity);
    }

    fn takes_gains(&self) -> bool {
        false
    }

    fn shortest(&self) -> (Form, usize, usize) {
        (Form::Packet, 9, 7)
    }

    fn write(&mut self, _order: &Order, _frames: &mut Vec<Frame>) {}

    fn member(&self) -> Option<&dyn Member> {
        Some(self)
    }

    fn member_mut(&mut self) -> Option<&mut dyn Member> {
        Some(self)
    }
}
