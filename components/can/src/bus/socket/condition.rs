//! Condition of a computer's bus, and counters of its events.

use crate::bus::report::{ErrorState, Report};

/// Condition of a bus, ordered from best to worst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Condition {
    /// Error-active: the bus sends and receives.
    #[default]
    Active,
    /// Error warning: the bus sends and receives, but the controller has counted many errors.
    Warning,
    /// Error-passive: the bus sends and receives, but the controller has counted too many errors to signal
    /// them to other nodes.
    Passive,
    /// Bus-off: the controller has left the bus.
    Off,
    /// The interface is down.
    Down,
    /// The interface no longer exists.
    Gone,
}

impl Condition {
    /// Returns `true` if frames can be sent.
    pub fn can_send(self) -> bool {
        matches!(self, Self::Active | Self::Warning | Self::Passive)
    }

    /// Returns the name of the condition in results and tables.
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

/// Counters of events on a bus since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SocketCounts {
    /// Number of reports of the controller.
    pub reports: u64,
    /// Number of frames that no node acknowledged.
    pub unacknowledged: u64,
    /// Number of disturbed frames from any node.
    pub disturbed: u64,
    /// Number of bus-off events of the controller.
    pub bus_off: u64,
    /// Number of batches that were not accepted completely because the interface's queue was full.
    pub queue_full: u64,
    /// Number of times that the interface went down or disappeared.
    pub down: u64,
    /// Number of received frames lost because the socket's buffer was full, plus the number of overflows that
    /// the controller has reported.
    pub overflows: u64,
    /// Number of remote requests and invalid frames.
    pub other: u64,
}

impl SocketCounts {
    /// Counts a report of the controller; `before` is the condition of the bus before the report.
    pub(in crate::bus) fn take(&mut self, report: &Report, before: Condition) {
        self.reports += 1;
        self.unacknowledged += u64::from(report.is_unacknowledged);
        self.disturbed += u64::from(report.is_disturbed);
        self.overflows += u64::from(report.is_overflow);
        self.bus_off += u64::from(report.state == Some(ErrorState::Off) && before != Condition::Off);
    }
}
