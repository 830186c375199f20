//! Contents of frames from drives.

use crate::adapter::WrongSetting;
use crate::mit::{Fault, Feedback, State};

/// Content of a frame from a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::adapter) enum Response {
    /// State of the drive: the answer of the cycle.
    Feedback(Feedback),
    /// A setting that matches the table (`None`), or its mismatch.
    Setting(Option<WrongSetting>),
    /// Operating state, sent apart from the answers.
    State(State),
    /// Heartbeat: the drive is alive.
    Alive,
    /// A setting does not have its value yet and is read again.
    Waiting,
    /// Error reported in a separate message, and its presence.
    Emergency { fault: Fault, is_present: bool },
    /// The drive has just started and has lost its configuration.
    Restarted,
    /// Any other frame.
    Other,
}
