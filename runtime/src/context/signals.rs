//! Messages from the watcher thread of a process to its stepping thread.

use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};

/// Messages from the watcher thread of a process to its stepping thread.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    /// Set when this process receives a request to end.
    terminated: Arc<AtomicBool>,
    /// Time at which the request was noticed, `CLOCK_MONOTONIC` ns; 0 before.
    terminated_ns: AtomicU64,
    /// Time at which the launcher was found dead, `CLOCK_MONOTONIC` ns; 0 while it is alive.
    launcher_died_ns: AtomicU64,
    /// Number of messages sent.
    sent: AtomicU32,
    /// Number of the last message that the stepping thread has seen.
    seen: AtomicU32,
}

impl Signals {
    /// Returns the flag that a request to end sets.
    pub(crate) fn terminated(&self) -> Arc<AtomicBool> {
        self.terminated.clone()
    }

    #[inline]
    pub(super) fn is_terminated(&self) -> bool {
        self.terminated.load(Relaxed)
    }

    /// Records the time of a request to end, if there was one.
    pub(crate) fn note_termination(&self, now_ns: u64) {
        if self.is_terminated() && self.terminated_ns.load(Relaxed) == 0 {
            self.terminated_ns.store(now_ns, Relaxed);
        }
    }

    /// Returns the time since which actuators must be in their safe state without a request from the
    /// launcher, ns: when this process was requested to end, or the launcher died. `u64::MAX` until the time
    /// of a request is recorded.
    #[inline]
    pub(super) fn on_its_own_since_ns(&self) -> Option<u64> {
        let noted = |cell: &AtomicU64| Some(cell.load(Relaxed)).filter(|ns| *ns != 0);
        let asked = || self.is_terminated().then(|| noted(&self.terminated_ns).unwrap_or(u64::MAX));
        match (noted(&self.launcher_died_ns), asked()) {
            (Some(died), Some(asked)) => Some(died.min(asked)),
            (died, asked) => died.or(asked),
        }
    }

    /// Records that the launcher was found dead at `now_ns`.
    pub(crate) fn launcher_died(&self, now_ns: u64) {
        self.launcher_died_ns.store(now_ns, Relaxed);
    }

    /// Sends a message; returns its number.
    pub(crate) fn send(&self) -> u32 {
        let message = self.sent.load(Relaxed).wrapping_add(1);
        self.sent.store(message, Release);
        message
    }

    /// Returns `true` if the stepping thread has seen a message.
    pub(crate) fn has_seen(&self, message: u32) -> bool {
        self.seen.load(Acquire) == message
    }

    /// Records that the stepping thread has seen all messages so far.
    #[inline]
    pub(super) fn acknowledge(&self) {
        self.seen.store(self.sent.load(Acquire), Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settling_starts_with_the_first_end_or_death() {
        let signals = Signals::default();
        assert_eq!(signals.on_its_own_since_ns(), None);
        signals.note_termination(5);
        assert_eq!(signals.on_its_own_since_ns(), None, "no request");
        signals.terminated().store(true, Relaxed);
        assert_eq!(signals.on_its_own_since_ns(), Some(u64::MAX), "not recorded yet");
        signals.note_termination(7);
        signals.note_termination(9);
        signals.launcher_died(8);
        assert_eq!(signals.on_its_own_since_ns(), Some(7));
    }
}
