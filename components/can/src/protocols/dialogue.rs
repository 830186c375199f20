//! Dialogues with drives, which convert orders of the adapter to frames of a protocol, and frames of a drive
//! to responses.

use super::homing_fault::HomingFault;
use super::setting::WrongSetting;
use crate::drive::{Command, Fault, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame};
use crate::protocols::entries::LoopEntry;
use crate::servo;

/// Request of the adapter to a drive in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Order {
    /// Read or write the setting with this number.
    Check(u8),
    /// Disable the drive.
    Disable,
    /// Only answer. The drive has reported a fault, which stays latched.
    Rest,
    /// Search for the mark.
    Home,
    /// Start following commands.
    Enable,
    /// Follow a command, in units of the output shaft.
    Follow(Command),
}

/// Content of a frame from a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Response {
    /// State of the drive: the answer of the cycle.
    Feedback(Feedback),
    /// Result of checking a setting: `None` if it matches the table.
    Setting(Option<WrongSetting>),
    /// Operating state, sent separately from the answers.
    State(State),
    /// Heartbeat: the drive is alive.
    Alive,
    /// A setting does not have the expected value yet, and is read again.
    Waiting,
    /// Error reported in a separate message; `is_present` is `false` if it is not active.
    Emergency { fault: Fault, is_present: bool },
    /// The drive has just started and has lost its configuration.
    Restarted,
    /// Any other frame.
    Other,
}

/// Dialogue with one drive.
///
/// Each cycle the adapter calls [`write`](Self::write) with its order, and [`read`](Self::read) with each
/// frame of the drive.
pub(crate) trait Dialogue {
    /// Returns the number of settings checked before the drive is enabled.
    fn checks(&self) -> u8 {
        0
    }

    /// Returns `true` if the gains of commands reach the drive.
    fn takes_gains(&self) -> bool;

    /// Returns `true` if the drive reports whether it is enabled.
    fn reports_state(&self) -> bool {
        true
    }

    /// Returns the period of a drive that reports unsolicited; `None` for one that answers commands.
    fn reports_every_ns(&self) -> Option<u64> {
        None
    }

    /// Returns the maximum time between two heartbeats, or between two state messages of a drive whose
    /// answers lack the state, ns.
    fn state_within_ns(&self) -> Option<u64> {
        None
    }

    /// Returns the form of the drive's frames, and number of bytes in the shortest command and in the
    /// shortest answer.
    fn shortest(&self) -> (Form, usize, usize);

    /// Sets the time between two cycles, ns.
    fn set_cycle(&mut self, _cycle_ns: u64) {}

    /// Accepts an answer as plausible; setpoints may then be derived from it.
    fn accept(&mut self, _feedback: &Feedback) {}

    /// Restarts the dialogue with a drive that was lost or has disabled itself, and clears its faults.
    fn restart(&mut self) {}

    /// Resets the dialogue to its initial state, without clearing faults.
    fn forget(&mut self) {}

    /// Starts the search for the mark, in a drive with a homing procedure.
    fn begin_homing(&mut self) {}

    /// Returns the result of the drive's own homing, once it has finished.
    fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        None
    }

    /// Returns `true` if the frame comes from this drive.
    fn is_from(&self, frame: &Frame) -> bool;

    /// Writes the frames of a cycle. The frames for a [`member`](Self::member) are written together with
    /// those for the rest of its line.
    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>);

    /// Returns `true` if the drive answers this order only after the synchronisation of its bus.
    fn is_synchronised(&self, _order: &Order) -> bool {
        false
    }

    /// Writes the frames that synchronise all such drives of a bus, after the drives' own frames.
    fn synchronise(&self, _frames: &mut Vec<Frame>) {}

    /// Returns the drive as a member of a serial line whose drives are written and queried together.
    fn member(&self) -> Option<&dyn Member> {
        None
    }

    /// Returns mutable access to [`member`](Self::member).
    fn member_mut(&mut self) -> Option<&mut dyn Member> {
        None
    }

    /// Reads a frame of this drive while the setting `checking` is being checked.
    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError>;
}

/// Registers of a servo: the first register, and the number of bytes.
pub(crate) type Registers = (u16, u8);

/// Registers that the servos of a line share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    /// Protocol of the packets.
    pub(crate) protocol: servo::Protocol,
    /// Registers written in a cycle, in the given order.
    pub(crate) written: &'static [Registers],
    /// Registers read from a servo: first the settings, one after the other, then the state.
    pub(crate) read: &'static [Registers],
}

/// Member of a serial line. One packet writes the goals of all members, one packet queries all of them.
pub(crate) trait Member {
    /// Returns the number of the servo.
    fn number(&self) -> u8;

    /// Returns the registers of all members of the line.
    fn layout(&self) -> &'static Layout;

    /// Returns the index in [`Layout::read`] of the block to read for an order.
    fn block(&self, order: &Order) -> usize;

    /// Writes the registers that an order requires. Passes the index of each block in [`Layout::written`],
    /// and its bytes, to `put`.
    fn put(&mut self, order: &Order, put: &mut dyn FnMut(usize, &[u8]));
}

/// Newest state of a drive in position or torque mode, from which its setpoints are derived.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    /// Position held while commands have no position gain.
    pub(crate) held: Option<f64>,
}

impl Motion {
    /// Begins a cycle. A drive that does not follow commands yet has no held position, because its joint may
    /// have been moved.
    pub(crate) fn begin(&mut self, order: &Order) {
        if !matches!(order, Order::Follow(_)) {
            self.held = None;
        }
    }

    /// Returns the position to command. Without a position gain, it is the drive's position at the first such
    /// command.
    pub(crate) fn target(&mut self, command: &Command) -> f64 {
        if command.kp > 0.0 {
            self.held = None;
            command.position
        } else {
            *self.held.get_or_insert(self.position)
        }
    }

    /// Returns the velocity setpoint for a command at the newest state: the commanded velocity plus the
    /// velocity at which the drive's own loop would approach the commanded position.
    pub(crate) fn velocity(&self, command: &Command, gains: LoopEntry, ranges: &Ranges) -> f64 {
        let towards =
            if command.kp > 0.0 { gains.kp / gains.kd * (command.position - self.position) } else { 0.0 };
        (command.velocity + towards).clamp(ranges.velocity.min, ranges.velocity.max)
    }

    /// Returns the torque for a command at the newest state.
    pub(crate) fn torque(&self, command: &Command, ranges: &Ranges) -> f64 {
        command.torque_at(self.position, self.velocity).clamp(ranges.torque.min, ranges.torque.max)
    }
}
