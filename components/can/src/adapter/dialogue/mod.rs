//! Dialogues with drives: they turn orders of the adapter into frames of a protocol, and frames of a drive
//! into responses.

mod cia402;
mod mit;
mod moteus;
mod motion;
mod odrive;
mod order;
mod response;
mod servo;

use super::HomingFault;
use crate::frame::{DecodeError, Form, Frame};
use crate::mit::Feedback;
use crate::table::{ControlMode, Protocol, Table};
pub(super) use order::Order;
pub(super) use response::Response;
use servo::Servo;

/// Dialogue with one drive.
#[derive(Clone, Debug)]
pub(super) enum Dialogue {
    Mit(mit::Mit),
    Odrive(odrive::Odrive),
    Cia402(cia402::Cia402),
    Moteus(moteus::Moteus),
    Servo(Servo),
}

impl Dialogue {
    /// Creates the dialogue with drive `index` of a table.
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

    /// Number of settings checked before the drive is enabled.
    pub(super) fn checks(&self) -> u8 {
        match self {
            Self::Mit(drive) => drive.checks(),
            Self::Cia402(drive) => drive.checks(),
            Self::Servo(drive) => drive.checks(),
            Self::Moteus(drive) => drive.checks(),
            Self::Odrive(_) => 0,
        }
    }

    /// Returns `true` if the gains of commands reach the drive.
    pub(super) fn takes_gains(&self) -> bool {
        match self {
            Self::Mit(_) | Self::Moteus(_) => true,
            Self::Odrive(drive) => drive.mode == ControlMode::Torque,
            Self::Cia402(drive) => drive.mode == ControlMode::Torque,
            Self::Servo(_) => false,
        }
    }

    /// Returns `true` if the drive reports whether it is enabled.
    pub(super) fn tells_its_state(&self) -> bool {
        match self {
            Self::Mit(drive) => drive.tells_its_state(),
            Self::Servo(drive) => drive.tells_its_state(),
            _ => true,
        }
    }

    /// Period of a drive that reports unsolicited; `None` for one that answers commands.
    pub(super) fn reports_every_ns(&self) -> Option<u64> {
        match self {
            Self::Odrive(drive) => Some(drive.every_ns),
            _ => None,
        }
    }

    /// Longest time, ns, between two heartbeats, or between two state messages of a drive whose answers lack
    /// the state.
    pub(super) fn state_within_ns(&self) -> Option<u64> {
        match self {
            Self::Odrive(_) => Some(odrive::HEARTBEAT_WITHIN_NS),
            Self::Cia402(drive) => drive.state_within_ns(),
            _ => None,
        }
    }

    /// Accepts an answer as plausible, so that setpoints may be derived from it.
    pub(super) fn accept(&mut self, feedback: &Feedback) {
        match self {
            Self::Mit(drive) => drive.accept(feedback),
            Self::Odrive(drive) => drive.accept(feedback),
            Self::Cia402(drive) => drive.accept(feedback),
            Self::Servo(drive) => drive.accept(feedback),
            Self::Moteus(_) => {}
        }
    }

    /// Form of the drive's frames, and bytes of the shortest command and the shortest answer.
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

    /// Restarts the dialogue, and clears the faults of a drive that was lost or disabled itself.
    pub(super) fn restart(&mut self) {
        match self {
            Self::Mit(_) | Self::Servo(_) => {}
            Self::Moteus(drive) => drive.restart(),
            Self::Odrive(drive) => drive.restart(),
            Self::Cia402(drive) => drive.restart(),
        }
    }

    /// Discards the dialogue's progress, as at the start, without clearing faults.
    pub(super) fn forget(&mut self) {
        match self {
            Self::Mit(_) | Self::Servo(_) | Self::Moteus(_) => {}
            Self::Odrive(drive) => drive.forget(),
            Self::Cia402(drive) => drive.forget(),
        }
    }

    /// Starts the search for the mark.
    pub(super) fn begin_homing(&mut self) {
        match self {
            Self::Odrive(drive) => drive.begin_homing(),
            Self::Cia402(drive) => drive.begin_homing(),
            // these drives have no homing procedure
            Self::Mit(_) | Self::Moteus(_) | Self::Servo(_) => {}
        }
    }

    /// Result of the drive's own homing, once it has finished.
    pub(super) fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        match self {
            Self::Odrive(drive) => drive.homing_result(),
            Self::Cia402(drive) => drive.homing_result(),
            Self::Mit(_) | Self::Moteus(_) | Self::Servo(_) => None,
        }
    }

    /// Returns `true` if the frame comes from this drive.
    pub(super) fn is_from(&self, frame: &Frame) -> bool {
        match self {
            Self::Mit(drive) => drive.is_from(frame),
            Self::Odrive(drive) => drive.is_from(frame),
            Self::Cia402(drive) => drive.is_from(frame),
            Self::Moteus(drive) => drive.is_from(frame),
            Self::Servo(drive) => drive.is_from(frame),
        }
    }

    /// Writes the frames of a cycle. Servo frames are written for the whole line together.
    pub(super) fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        match self {
            Self::Mit(drive) => drive.write(order, frames),
            Self::Odrive(drive) => drive.write(order, frames),
            Self::Cia402(drive) => drive.write(order, frames),
            Self::Moteus(drive) => drive.write(order, frames),
            Self::Servo(_) => {}
        }
    }

    /// Reads a frame of this drive while the setting `checking` is being checked.
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
