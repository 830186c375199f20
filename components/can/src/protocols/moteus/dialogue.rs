//! Dialogue with moteus drives: one frame of registers in each direction per cycle.
//!
//! Gains of commands are fractions of the gains stored in the drive, and every command contains the watchdog
//! time. The drive reports its position reference before it is enabled.

use super::codec::{self, Home, Instruction, Mode, Node, Resolution};
use crate::drive::{Fault, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame};
use crate::protocols::dialogue::{Dialogue, Order, Response};
use crate::protocols::entries::LoopEntry;
use crate::protocols::setting::WrongSetting;
use crate::protocols::spec::DriveSetup;

/// 16-bit registers; positions resolve 0.6 mrad.
const RESOLUTION: Resolution = Resolution::Int16;

#[derive(Clone, Debug)]
pub(crate) struct Moteus {
    node: Node,
    gains: LoopEntry,
    ranges: Ranges,
    /// Watchdog time, s; NaN for never.
    watchdog: f64,
    /// Minimum position reference required.
    reference: Home,
    /// Remaining cycles of the fault reset.
    clears: u8,
}

/// Duration of a fault reset, cycles.
const CLEARS: u8 = 4;

impl Moteus {
    pub(crate) fn new(setup: &DriveSetup<'_>) -> Self {
        let entry = setup.entry;
        Self {
            node: Node::new(entry.node).unwrap_or(Node::FIRST),
            gains: setup.gains,
            ranges: setup.ranges,
            watchdog: if entry.watchdog.ns > 0 { entry.watchdog.ns as f64 * 1e-9 } else { f64::NAN },
            // homing determines the position of these joints
            reference: if entry.homing.is_some() {
                Home::Relative
            } else {
                entry.reference.unwrap_or_default().into()
            },
            clears: 0,
        }
    }
}

impl Dialogue for Moteus {
    fn checks(&self) -> u8 {
        u8::from(self.reference > Home::Relative)
    }

    fn restart(&mut self) {
        self.clears = CLEARS;
    }

    fn is_from(&self, frame: &Frame) -> bool {
        frame.id == self.node.reply_id()
    }

    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        let share = |gain: f64, all: f64| if all > 0.0 { (gain / all).clamp(0.0, 1.0) } else { 0.0 };
        let limits = codec::Command {
            max_torque: self.ranges.torque.max,
            watchdog: self.watchdog,
            ..codec::Command::default()
        };
        let instruction = match order {
            Order::Rest => Instruction::Query,
            // stopping also clears a fault
            Order::Check(_) | Order::Disable | Order::Home => Instruction::Stop,
            Order::Enable => Instruction::Position(codec::Command { kp_scale: 0.0, ..limits }),
            Order::Follow(command) => Instruction::Position(codec::Command {
                position: if command.kp > 0.0 { command.position } else { f64::NAN },
                velocity: command.velocity,
                torque: command.torque,
                kp_scale: share(command.kp, self.gains.kp),
                kd_scale: share(command.kd, self.gains.kd),
                ..limits
            }),
        };
        self.clears = self.clears.saturating_sub(1);
        frames.push(self.node.frame(&instruction, RESOLUTION));
    }

    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        let reported = self.node.reply(frame)?;
        if checking.is_some() {
            let (found, expected) = (reported.home.unwrap_or(Home::Relative), self.reference);
            return Ok(Response::Setting(
                (found < expected).then_some(WrongSetting::Reference { found, expected }),
            ));
        }
        let state = match reported.mode {
            Mode::Position | Mode::ZeroVelocity | Mode::StayWithin => State::Enabled,
            Mode::Fault | Mode::Timeout if self.clears > 0 => State::Disabled,
            Mode::Fault => State::Fault(fault(reported.fault)),
            Mode::Timeout => State::Fault(Fault::CommunicationLost),
            _ => State::Disabled,
        };
        Ok(Response::Feedback(Feedback {
            position: reported.position,
            velocity: reported.velocity,
            torque: reported.torque,
            // the higher of board and motor temperature
            temperature: Some(
                reported
                    .motor_temperature
                    .map_or(reported.temperature, |motor| motor.max(reported.temperature)),
            ),
            voltage: Some(reported.voltage),
            state,
        }))
    }

    fn takes_gains(&self) -> bool {
        true
    }

    fn shortest(&self) -> (Form, usize, usize) {
        (Form::FdFast, 12, 20)
    }
}

/// Returns the fault for a moteus code.
fn fault(code: u8) -> Fault {
    match code {
        34 => Fault::OverVoltage,
        35 | 42 | 43 => Fault::Encoder,
        38 => Fault::HotTransistors,
        40 => Fault::UnderVoltage,
        code => Fault::Other(code.into()),
    }
}
