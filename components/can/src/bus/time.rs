//! The clocks of the computer, read without a system call.

use rustix::time::{ClockId, clock_gettime};

/// The time of a clock, ns.
fn now_ns(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Time on the monotonic clock of all stamps, ns.
pub(crate) fn monotonic_ns() -> u64 {
    now_ns(ClockId::Monotonic)
}

/// Time on the wall clock, which the kernel uses for its stamps, ns.
pub(super) fn realtime_ns() -> u64 {
    now_ns(ClockId::Realtime)
}

/// Time after which a missing interface is searched again, ns.
const AGAIN_NS: u64 = 1_000_000_000;

/// The time at which a line or an interface that has gone is looked for again: once a second.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retry {
    at_ns: u64,
}

impl Retry {
    /// It has just disappeared.
    pub(super) fn begin(&mut self) {
        self.at_ns = monotonic_ns() + AGAIN_NS;
    }

    /// True once a second.
    pub(super) fn is_due(&mut self) -> bool {
        let is_due = monotonic_ns() >= self.at_ns;
        if is_due {
            self.begin();
        }
        is_due
    }
}
