//! Interval between two readings.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use crate::runs::LivingRun;

/// Shortest interval between two readings; shorter ones would disturb the measurement.
pub(super) const SHORTEST: Duration = Duration::from_millis(100);
/// Longest interval.
pub(super) const LONGEST: Duration = Duration::from_secs(3600);

/// Reason for the end of the display.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// Requested by the user.
    Asked,
    /// The run is over.
    RunOver,
}

/// Waits for an interval; returns the reason if it was interrupted.
pub(super) fn wait(run: &LivingRun, interval: Duration, interrupted: &AtomicBool) -> Option<End> {
    let due = Instant::now() + interval;
    loop {
        let left = due.saturating_duration_since(Instant::now());
        std::thread::sleep(left.min(Duration::from_millis(100)));
        if interrupted.load(Relaxed) {
            return Some(End::Asked);
        }
        if run.has_ended() {
            return Some(End::RunOver);
        }
        if Instant::now() >= due {
            return None;
        }
    }
}
