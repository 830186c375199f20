//! The notifier of a topic: how a publication wakes those who wait for it, and how the launcher interrupts
//! them.
//!
//! A waiter names the last publication it has seen, counts itself as sleeping, and sleeps on the word of the
//! newest publication only while that has not changed. A writer announces a publication and then asks whether
//! anybody sleeps: it makes a system call only then. Either the writer finds the sleeper, or the sleeper
//! finds the publication, so none is lost.

use std::sync::atomic::Ordering::{Acquire, Relaxed, SeqCst};

use super::protocol::{Head, Newest};
use crate::atomics::{Atomics, Site, Word};

/// Sleeping on a word, and waking those who do.
pub(crate) trait Futex<A: Atomics> {
    /// Sleeps while the word's low half is that of `seen`; may return early.
    fn sleep(&self, word: &A::U64, seen: u64);
    /// Wakes all who sleep on the word.
    fn wake(&self, word: &A::U64);
}

/// Wakes those who sleep until the next publication; to be called after one was announced.
#[inline(always)]
pub(crate) fn notify<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>) {
    A::fence_after_exchange(Site::Notify);
    if head.sleepers.load(Relaxed) != 0 {
        futex.wake(&head.newest);
    }
}

/// Makes all who wait look up, although nothing was published. Not for the hot path.
pub(crate) fn interrupt<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>) {
    loop {
        let seen = Newest(head.newest.load(Acquire));
        if head.newest.replace(seen.0, seen.interrupted().0) {
            break;
        }
    }
    notify(head, futex);
}

/// Sleeps until the word of the newest publication is no longer `seen`; may return early, for a signal.
#[inline(always)]
pub(crate) fn sleep<A: Atomics>(head: &Head<A>, futex: &impl Futex<A>, seen: Newest) {
    head.sleepers.fetch_add(1, SeqCst);
    A::fence_after_exchange(Site::Sleep);
    futex.sleep(&head.newest, seen.0);
    head.sleepers.fetch_sub(1, SeqCst);
}
