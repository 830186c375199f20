//! The clocks of the computer, read without a system call.

use rustix::time::{ClockId, clock_gettime};

/// The time of a clock, ns.
fn now_ns(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Time on the monotonic clock, ns: that of all stamps.
pub(super) fn monotonic_ns() -> u64 {
    now_ns(ClockId::Monotonic)
}

/// Time on the clock of the day, ns: that of the kernel's own stamps.
pub(super) fn realtime_ns() -> u64 {
    now_ns(ClockId::Realtime)
}
