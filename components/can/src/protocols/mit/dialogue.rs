//! Dialogue with drives of the MIT family: one frame in each direction per cycle.

use super::codec::{Drive, Instruction, Reply};
use super::damiao::{Register, Request, Value};
use super::rounding::Rounding;
use crate::drive::{Command, Feedback};
use crate::frame::{DecodeError, Form, Frame};
use crate::protocols::dialogue::{Dialogue, Motion, Order, Response};
use crate::protocols::setting::WrongSetting;

/// Number of registers read from every Damiao drive.
const CHECKED: u8 = Register::CHECKED.len() as u8;

#[derive(Clone, Debug)]
pub(crate) struct Mit {
    codec: Drive,
    watchdog_ns: u64,
    /// Fraction of its full current at which a Damiao drive disables itself; `None` keeps the drive's
    /// setting.
    share: Option<f64>,
    /// Newest state; `None` before the first answer.
    motion: Option<Motion>,
    rounding: Rounding,
}

impl Mit {
    pub(crate) fn new(codec: Drive, watchdog_ns: u64, share: Option<f64>) -> Self {
        Self { codec, watchdog_ns, share, motion: None, rounding: Rounding::default() }
    }

    fn request(&self, setting: u8) -> Request {
        let register = Register::CHECKED.get(usize::from(setting)).copied().unwrap_or(Register::OverCurrent);
        Request { node: self.codec.node, register }
    }

    /// Checks the answer to a settings request.
    fn check(&self, setting: u8, frame: &Frame) -> Result<Option<WrongSetting>, DecodeError> {
        let request = self.request(setting);
        if setting == CHECKED {
            return request.changed_value(frame, self.codec.reply_id).map(|_| None);
        }
        let value = request.value(frame, self.codec.reply_id)?;
        let ranges = self.codec.ranges();
        let expected = match request.register {
            Register::PositionMax => ranges.position.max,
            Register::VelocityMax => ranges.velocity.max,
            Register::TorqueMax | Register::Timeout | Register::ControlMode => ranges.torque.max,
            Register::OverCurrent => self.share.unwrap_or_default(),
        };
        Ok(match value {
            Value::Watchdog(found) => (found.unwrap_or(0) != self.watchdog_ns)
                .then_some(WrongSetting::Watchdog { found, expected: self.watchdog_ns }),
            Value::Mode(found) => (found != Register::MIT_MODE).then_some(WrongSetting::ControlMode {
                found: i64::from(found),
                expected: i64::from(Register::MIT_MODE),
                register: "register 10",
            }),
            Value::Number(found) if request.register == Register::OverCurrent => {
                ((found - expected).abs() > 1e-5).then_some(WrongSetting::CurrentLimit { found, expected })
            }
            Value::Number(found) => ((found - expected).abs() > 1e-5 * expected.abs())
                .then_some(WrongSetting::Range { register: request.register.name(), found, expected }),
        })
    }
}

impl Dialogue for Mit {
    fn checks(&self) -> u8 {
        // the current limit is written and read back
        let limit = if self.share.is_some() { 2 } else { 0 };
        if self.codec.reply == Reply::Damiao { CHECKED + limit } else { 0 }
    }

    fn reports_state(&self) -> bool {
        self.codec.reply == Reply::Damiao
    }

    fn shortest(&self) -> (Form, usize, usize) {
        (self.codec.form, 8, self.codec.reply.length())
    }

    fn is_from(&self, frame: &Frame) -> bool {
        self.codec.reply_id == frame.id
    }

    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        let instruction = match *order {
            Order::Check(setting) => {
                let request = self.request(setting);
                let frame = match self.share {
                    Some(share) if setting == CHECKED => request.change(share),
                    _ => request.frame(),
                };
                frames.push(frame.in_form(self.codec.form));
                return;
            }
            Order::Disable | Order::Home => Instruction::Disable,
            // a zero command, which the drive answers
            Order::Rest => Instruction::Command(Command::default()),
            Order::Enable => Instruction::Enable,
            Order::Follow(command) => {
                let Self { codec, motion, rounding, .. } = self;
                let state = motion.map(|motion| (motion.position, motion.velocity));
                frames.push(codec.command(&rounding.command(&command, codec, state)));
                return;
            }
        };
        self.rounding = Rounding::default();
        frames.push(self.codec.instruct(&instruction));
    }

    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        match checking {
            Some(register) => self.check(register, frame).map(Response::Setting),
            None => self.codec.reply(frame).map(Response::Feedback),
        }
    }

    fn accept(&mut self, feedback: &Feedback) {
        let (position, velocity) = (feedback.position, feedback.velocity);
        self.motion = Some(Motion { position, velocity, held: None });
    }

    fn takes_gains(&self) -> bool {
        true
    }
}
