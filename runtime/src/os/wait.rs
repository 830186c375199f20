//! Clocks, sleeping, and process-shared futexes.

use std::sync::atomic::AtomicU32;
use std::time::Duration;

use rustix::thread::{ClockId, futex};
use rustix::time::Timespec;

/// Returns the time of `CLOCK_MONOTONIC`, ns. Uses the vDSO, without a system call.
#[inline]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Returns the time of `CLOCK_BOOTTIME`, which continues during suspend, ns. Uses the vDSO, without a system
/// call.
#[inline]
pub fn boottime_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Boottime);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Returns the time of `CLOCK_REALTIME`, which may be adjusted at any time, ns. Uses the vDSO, without a
/// system call.
#[inline]
pub fn realtime_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Realtime);
    u64::try_from(now.tv_sec).unwrap_or(0) * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until `CLOCK_MONOTONIC` reaches `deadline_ns`. Returns early if a signal arrives.
pub fn sleep_until(deadline_ns: u64) {
    let deadline = Timespec {
        tv_sec: (deadline_ns / 1_000_000_000) as i64,
        tv_nsec: (deadline_ns % 1_000_000_000) as _,
    };
    // An error means an interrupting signal; the caller reads the clock again in any case.
    let _ = rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &deadline);
}

/// Waits until `word` differs from `value`, a process wakes the waiters, a signal arrives, or the timeout
/// passes.
///
/// The word may be in shared memory. Returns `true` if a signal ended the wait. May return early with the
/// word unchanged, because a late wake-up for an earlier value can end the wait.
#[inline(always)]
pub fn futex_wait(word: &AtomicU32, value: u32, timeout: Option<Duration>) -> bool {
    let timeout = timeout.map(|t| Timespec { tv_sec: t.as_secs() as i64, tv_nsec: t.subsec_nanos() as _ });
    // After every other outcome the caller reads the word again.
    futex::wait(word, futex::Flags::empty(), value, timeout.as_ref()) == Err(rustix::io::Errno::INTR)
}

/// Wakes all threads that wait on `word`.
#[inline(always)]
pub fn futex_wake(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::empty(), i32::MAX as u32);
}

/// Returns the core on which the calling thread runs, without a system call.
pub fn current_core() -> usize {
    rustix::thread::sched_getcpu()
}

/// Yields the core to waiting threads of the same priority.
pub fn yield_core() {
    rustix::thread::sched_yield();
}
