//! Clocks of the computer, read without a system call.

use rustix::time::{ClockId, clock_gettime};

/// Returns the time of a clock, ns.
fn now_ns(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Returns the time of the monotonic clock, ns, used by all stamps.
pub(crate) fn monotonic_ns() -> u64 {
    now_ns(ClockId::Monotonic)
}

/// Returns the time of the wall clock, ns, used by the kernel's timestamps.
pub(super) fn realtime_ns() -> u64 {
    now_ns(ClockId::Realtime)
}

/// Interval between attempts to reopen a line or an interface, ns.
const AGAIN_NS: u64 = 1_000_000_000;

/// Timer that retries opening a lost line or interface once per second.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retry {
    at_ns: u64,
}

impl Retry {
    /// Starts the timer when the line or interface is lost.
    pub(super) fn begin(&mut self) {
        self.at_ns = monotonic_ns() + AGAIN_NS;
    }

    /// Returns `true` once a second.
    pub(super) fn is_due(&mut self) -> bool {
        let is_due = monotonic_ns() >= self.at_ns;
        if is_due {
            self.begin();
        }
        is_due
    }
}
