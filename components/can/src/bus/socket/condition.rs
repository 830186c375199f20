//! The condition of a bus of the computer, and counts of its events.

use crate::bus::report::{ErrorState, Report};

/// The condition of a bus, the best first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Condition {
    /// Sends and receives.
    #[default]
    Active,
    /// Sends and receives; its controller has counted many errors.
    Warning,
    /// Sends and receives; its controller has counted so many errors that it no longer signals them.
    Passive,
    /// Its controller has left the bus.
    Off,
    /// The interface is down.
    Down,
    /// There is no such interface any more.
    Gone,
}

impl Condition {
    /// True if frames can be sent.
    pub fn can_send(self) -> bool {
        matches!(self, Self::Active | Self::Warning | Self::Passive)
    }

    /// Its name, as results and tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Warning => "warning",
            Self::Passive => "passive",
            Self::Off => "bus-off",
            Self::Down => "down",
            Self::Gone => "gone",
        }
    }
}

impl From<ErrorState> for Condition {
    fn from(state: ErrorState) -> Self {
        match state {
            ErrorState::Active => Self::Active,
            ErrorState::Warning => Self::Warning,
            ErrorState::Passive => Self::Passive,
            ErrorState::Off => Self::Off,
        }
    }
}

/// Counts of events on a kernel bus since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SocketCounts {
    /// Reports of the controller.
    pub reports: u64,
    /// Frames without an acknowledgement.
    pub unacknowledged: u64,
    /// Frames that were disturbed, of any node.
    pub disturbed: u64,
    /// Times that the controller left the bus.
    pub bus_off: u64,
    /// Batches of which frames were not taken because the interface's queue was full.
    pub queue_full: u64,
    /// Times that the interface went down or away.
    pub down: u64,
    /// Received frames lost for lack of room: in the socket, or in the controller as it reports.
    pub overflows: u64,
    /// Remote requests and malformed frames.
    pub other: u64,
}

impl SocketCounts {
    /// Counts a report of the controller of a bus that was in this condition.
    pub(in crate::bus) fn take(&mut self, report: &Report, before: Condition) {
        self.reports += 1;
        self.unacknowledged += u64::from(report.is_unacknowledged);
        self.disturbed += u64::from(report.is_disturbed);
        self.overflows += u64::from(report.is_overflow);
        self.bus_off += u64::from(report.state == Some(ErrorState::Off) && before != Condition::Off);
    }
}
