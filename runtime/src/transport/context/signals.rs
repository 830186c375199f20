//! Messages from the watcher thread of a process to its stepping thread.

use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};

/// Messages from the watcher thread of a process to its stepping thread.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    /// Set when this process was asked to end.
    terminated: Arc<AtomicBool>,
    /// Time at which the launcher was found dead, `CLOCK_MONOTONIC` ns; 0 while it lives.
    launcher_died_ns: AtomicU64,
    /// Number of messages sent.
    sent: AtomicU32,
    /// Number of the last message that the stepping thread has seen.
    seen: AtomicU32,
}

impl Signals {
    /// The flag that a request to end sets.
    pub(crate) fn terminated(&self) -> Arc<AtomicBool> {
        self.terminated.clone()
    }

    pub(super) fn is_terminated(&self) -> bool {
        self.terminated.load(Relaxed)
    }

    /// Notes that the launcher is dead, at `now_ns`.
    pub(crate) fn launcher_died(&self, now_ns: u64) {
        self.launcher_died_ns.store(now_ns, Relaxed);
    }

    pub(super) fn launcher_died_ns(&self) -> u64 {
        self.launcher_died_ns.load(Relaxed)
    }

    /// Sends a message; returns its number.
    pub(crate) fn send(&self) -> u32 {
        let message = self.sent.load(Relaxed).wrapping_add(1);
        self.sent.store(message, Release);
        message
    }

    /// True if the stepping thread has seen a message.
    pub(crate) fn has_seen(&self, message: u32) -> bool {
        self.seen.load(Acquire) == message
    }

    /// Notes that the stepping thread has seen all messages sent so far.
    pub(super) fn acknowledge(&self) {
        self.seen.store(self.sent.load(Acquire), Relaxed);
    }
}
