//! The notifier of a topic: how a publication wakes the waiters, and how the launcher interrupts them.
//!
//! A waiter increments the number of sleepers and then sleeps on the word of the newest publication, but only
//! if that word still equals the last publication it has seen. A writer announces a publication and makes a
//! system call only if it then finds a sleeper. Either the writer sees the sleeper or the sleeper sees the
//! publication, so no wake-up is lost.

use std::sync::atomic::Ordering::{Acquire, Relaxed, SeqCst};

use super::protocol::{Head, Newest};
use crate::atomics::{Atomics, Site, Word};

/// Puts threads to sleep on a word and wakes them.
pub(crate) trait Futex<A: Atomics> {
    /// Sleeps while the low half of the word equals the low half of `seen`; may return early.
    fn sleep(&self, word: &A::U64, seen: u64);
    /// Wakes all sleepers on the word.
    fn wake(&self, word: &A::U64);
}

/// Wakes all sleepers. Call it after a publication was announced.
#[inline(always)]
pub(crate) fn notify<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>) {
    A::fence_after_exchange(Site::Notify);
    if head.sleepers.load(Relaxed) != 0 {
        futex.wake(&head.newest);
    }
}

/// Wakes all sleepers without a publication, so that they check for commands. Not for the hot path.
pub(crate) fn interrupt<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>) {
    loop {
        let seen = Newest(head.newest.load(Acquire));
        if head.newest.replace(seen.0, seen.interrupted().0) {
            break;
        }
    }
    notify(head, futex);
}

/// Sleeps until the word of the newest publication differs from `seen`; may return early on a signal.
#[inline(always)]
pub(crate) fn sleep<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>, seen: Newest) {
    head.sleepers.fetch_add(1, SeqCst);
    A::fence_after_exchange(Site::Sleep);
    futex.sleep(&head.newest, seen.0);
    head.sleepers.fetch_sub(1, SeqCst);
}
