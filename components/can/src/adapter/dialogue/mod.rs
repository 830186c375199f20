//! The dialogues with drives: orders of the adapter become frames of a protocol, and frames of a drive
//! responses.

mod cia402;
mod mit;
mod moteus;
mod odrive;
mod servo;

use super::{HomingFault, WrongSetting};
use crate::frame::{DecodeError, Form, Frame};
use crate::mit::{Command, Fault, Feedback, Ranges, State};
use crate::table::{ControlMode, LoopEntry, Protocol, Table};
pub(super) use servo::Servo;

/// The request of the adapter to a drive in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    /// Read or write the setting with this number.
    Check(u8),
    /// Disable.
    Disable,
    /// To answer, and nothing else: it reported a fault, which stays.
    Rest,
    /// Search for its mark.
    Home,
    /// To begin to follow commands.
    Enable,
    /// To follow a command, in the units of its output shaft.
    Follow(Command),
}

/// The content of a frame of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Response {
    /// Its state: the answer of the cycle.
    Feedback(Feedback),
    /// That a setting is as the table has it, or else how it differs.
    Setting(Option<WrongSetting>),
    /// Its state, besides its answers.
    State(State),
    /// A sign of life: a heartbeat besides its answers.
    Alive,
    /// That a setting does not have its value yet: it is read again.
    Waiting,
    /// An error reported in a separate message, and whether it is still present.
    Emergency { fault: Fault, is_present: bool },
    /// It has just started without any settings.
    Restarted,
    /// A message besides its answers.
    Other,
}

/// The dialogue with one drive.
#[derive(Clone, Debug)]
pub(super) enum Dialogue {
    Mit(mit::Mit),
    Odrive(odrive::Odrive),
    Cia402(cia402::Cia402),
    Moteus(moteus::Moteus),
    Servo(Servo),
}

impl Dialogue {
    /// The dialogue with a drive of a table.
    pub(super) fn new(table: &Table, index: usize) -> Self {
        match (table.drives[index].protocol, table.drive(index)) {
            (_, Some(codec)) => {
                let entry = &table.drives[index];
                Self::Mit(mit::Mit::new(codec, entry.watchdog.ns, entry.current_register()))
            }
            (Protocol::Cia402, _) => Self::Cia402(cia402::Cia402::new(table, index)),
            (Protocol::Moteus, _) => Self::Moteus(moteus::Moteus::new(table, index)),
            (Protocol::Feetech | Protocol::Dynamixel, _) => Self::Servo(Servo::new(table, index)),
            _ => Self::Odrive(odrive::Odrive::new(table, index)),
        }
    }

    /// Settings that are checked before it is enabled.
    pub(super) fn checks(&self) -> u8 {
        match self {
            Self::Mit(drive) => drive.checks(),
            Self::Cia402(drive) => drive.checks(),
            Self::Servo(drive) => drive.checks(),
            Self::Moteus(drive) => drive.checks(),
            Self::Odrive(_) => 0,
        }
    }

    /// True if the gains of commands reach the drive.
    pub(super) fn takes_gains(&self) -> bool {
        match self {
            Self::Mit(_) | Self::Moteus(_) => true,
            Self::Odrive(drive) => drive.mode == ControlMode::Torque,
            Self::Cia402(drive) => drive.mode == ControlMode::Torque,
            Self::Servo(_) => false,
        }
    }

    /// Returns `true` if it reports whether it follows commands.
    pub(super) fn tells_its_state(&self) -> bool {
        match self {
            Self::Mit(drive) => drive.tells_its_state(),
            Self::Servo(drive) => drive.tells_its_state(),
            _ => true,
        }
    }

    /// Time between two reports of a drive that reports unasked; `None` for a drive that answers.
    pub(super) fn reports_every_ns(&self) -> Option<u64> {
        match self {
            Self::Odrive(drive) => Some(drive.every_ns),
            _ => None,
        }
    }

    /// Longest time between two messages with its state, ns, of a drive whose answers are without it, or
    /// between two heartbeats.
    pub(super) fn state_within_ns(&self) -> Option<u64> {
        match self {
            Self::Odrive(_) => Some(odrive::HEARTBEAT_WITHIN_NS),
            Self::Cia402(drive) => drive.state_within_ns(),
            _ => None,
        }
    }

    /// Enters an answer that is believed: setpoints may follow from it.
    pub(super) fn accept(&mut self, feedback: &Feedback) {
        match self {
            Self::Mit(drive) => drive.accept(feedback),
            Self::Odrive(drive) => drive.accept(feedback),
            Self::Cia402(drive) => drive.accept(feedback),
            Self::Servo(drive) => drive.accept(feedback),
            Self::Moteus(_) => {}
        }
    }

    /// Form of its frames, bytes of the shortest command and of the shortest answer.
    pub(super) fn shortest(&self) -> (Form, usize, usize) {
        match self {
            Self::Mit(drive) => drive.shortest(),
            Self::Moteus(_) => (Form::FdFast, 12, 20),
            // a synchronisation
            Self::Cia402(_) => (Form::Classic, 0, 6),
            Self::Servo(_) => (Form::Packet, 9, 7),
            Self::Odrive(_) => (Form::Classic, 8, 8),
        }
    }

    /// Restarts, and clears the faults of a drive that was lost or disabled.
    pub(super) fn restart(&mut self) {
        match self {
            Self::Mit(_) | Self::Servo(_) => {}
            Self::Moteus(drive) => drive.restart(),
            Self::Odrive(drive) => drive.restart(),
            Self::Cia402(drive) => drive.restart(),
        }
    }

    /// Resets to the initial state without clearing faults.
    pub(super) fn forget(&mut self) {
        match self {
            Self::Mit(_) | Self::Servo(_) | Self::Moteus(_) => {}
            Self::Odrive(drive) => drive.forget(),
            Self::Cia402(drive) => drive.forget(),
        }
    }

    /// Starts the search for its mark.
    pub(super) fn begin_homing(&mut self) {
        match self {
            Self::Odrive(drive) => drive.begin_homing(),
            Self::Cia402(drive) => drive.begin_homing(),
            // they have no homing procedure
            Self::Mit(_) | Self::Moteus(_) | Self::Servo(_) => {}
        }
    }

    /// Result of its own homing, once complete.
    pub(super) fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        match self {
            Self::Odrive(drive) => drive.homing_result(),
            Self::Cia402(drive) => drive.homing_result(),
            Self::Mit(_) | Self::Moteus(_) | Self::Servo(_) => None,
        }
    }

    /// True for a frame of this drive.
    pub(super) fn is_from(&self, frame: &Frame) -> bool {
        match self {
            Self::Mit(drive) => drive.is_from(frame),
            Self::Odrive(drive) => drive.is_from(frame),
            Self::Cia402(drive) => drive.is_from(frame),
            Self::Moteus(drive) => drive.is_from(frame),
            Self::Servo(drive) => drive.is_from(frame),
        }
    }

    /// Writes the frames of a cycle. All servos of a line share their frames.
    pub(super) fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        match self {
            Self::Mit(drive) => drive.write(order, frames),
            Self::Odrive(drive) => drive.write(order, frames),
            Self::Cia402(drive) => drive.write(order, frames),
            Self::Moteus(drive) => drive.write(order, frames),
            Self::Servo(_) => {}
        }
    }

    /// Reads a frame of this drive, while the setting `checking` is being checked.
    pub(super) fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        match self {
            Self::Mit(drive) => drive.read(checking, frame),
            Self::Odrive(drive) => drive.read(frame),
            Self::Cia402(drive) => drive.read(checking, frame),
            Self::Moteus(drive) => drive.read(checking, frame),
            Self::Servo(drive) => drive.read(checking, frame),
        }
    }
}

/// The newest state of a drive that is commanded positions or torques, from which its setpoints follow.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    position: f64,
    velocity: f64,
    /// The position at which it is held while its commands have no position gain.
    held: Option<f64>,
}

impl Motion {
    /// Begins a cycle: a drive that does not follow yet is not held, and may have been moved.
    fn begin(&mut self, order: &Order) {
        if !matches!(order, Order::Follow(_)) {
            self.held = None;
        }
    }

    /// The position of a command; without a position gain that at which the drive was then.
    fn target(&mut self, command: &Command) -> f64 {
        if command.kp > 0.0 {
            self.held = None;
            command.position
        } else {
            *self.held.get_or_insert(self.position)
        }
    }

    /// Velocity of a command at the newest state: the commanded velocity plus the velocity with which the
    /// drive's loop would approach the commanded position.
    fn velocity(&self, command: &Command, gains: LoopEntry, ranges: &Ranges) -> f64 {
        let towards =
            if command.kp > 0.0 { gains.kp / gains.kd * (command.position - self.position) } else { 0.0 };
        (command.velocity + towards).clamp(ranges.velocity.min, ranges.velocity.max)
    }

    /// The torque of a command at the newest state.
    fn torque(&self, command: &Command, ranges: &Ranges) -> f64 {
        command.torque_at(self.position, self.velocity).clamp(ranges.torque.min, ranges.torque.max)
    }
}
