//! Waiting for the publications of a topic.

use std::cell::Cell;
use std::rc::Rc;

use super::latest::TopicMemory;
use super::latest::protocol::{Newest, newest_with_time};
use crate::os::{Backoff, current_core, monotonic_ns};

/// Time for which a waiter polls for a publication from another core before it sleeps, ns: roughly the cost
/// of a wake-up from there.
pub(crate) const SPIN_NS: u64 = 20_000;

/// The waiting side of a topic, with which a triggered component sleeps until the next publication.
///
/// If the publisher runs on a different core, a wake-up costs far more than reading the data. Therefore the
/// waiter polls for about the duration of a wake-up before it sleeps. After an unsuccessful poll, the next
/// wait does not poll. With each further unsuccessful poll, the number of waits without polling doubles, up
/// to 64. A component that waits for a millisecond at a time thus spends less than 0.1 % of its core on
/// polling.
#[derive(Debug)]
pub struct Trigger {
    memory: Rc<TopicMemory>,
    seen: Cell<Newest>,
    backoff: Backoff,
}

impl Trigger {
    /// Creates a trigger. It is due from the first publication on or, if the component was restarted, from
    /// the next one.
    pub(super) fn new(memory: Rc<TopicMemory>, restarts: u32) -> Self {
        let seen = if restarts == 0 { Newest::default() } else { memory.newest() };
        Self { memory, seen: Cell::new(seen), backoff: Backoff::default() }
    }

    /// Waits for a publication, a launcher command, or a signal.
    pub fn wait(&self) {
        self.wait_until(None);
    }

    /// Waits like [`wait`](Self::wait), but at most until the clock reaches `until_ns`. Returns `true` if the
    /// calling thread slept.
    #[inline(always)]
    pub(crate) fn wait_until(&self, until_ns: Option<u64>) -> bool {
        let seen = self.seen.get();
        let sleeps = self.memory.newest() == seen && !self.poll(seen);
        if sleeps {
            self.memory.sleep(seen, until_ns);
        }
        self.seen.set(self.memory.newest());
        sleeps
    }

    /// Returns `true` if there was a publication since the last call or wait. Does not wait.
    pub fn is_due(&self) -> bool {
        let newest = self.memory.newest();
        self.seen.replace(newest).number() != newest.number()
    }

    /// Returns the number of the last publication that does not count as new for the first wait.
    pub(crate) fn first_seen(&self) -> u64 {
        self.seen.get().number()
    }

    /// Returns the number and time (ns on the clock of stamps) of the newest publication.
    #[inline]
    pub(crate) fn newest(&self) -> (u64, u64) {
        let (newest, time_ns) = newest_with_time(&*self.memory);
        (newest.number(), time_ns)
    }

    /// Polls for a publication without sleeping, if that is likely to pay off.
    fn poll(&self, seen: Newest) -> bool {
        let elsewhere = self.memory.core().is_some_and(|core| core != current_core());
        if !elsewhere || !self.backoff.may_poll() {
            return false;
        }
        let end = monotonic_ns() + SPIN_NS;
        let mut found = false;
        while !found && monotonic_ns() < end {
            for _ in 0..8 {
                core::hint::spin_loop();
                found |= self.memory.newest() != seen;
            }
        }
        self.backoff.learn(found);
        found
    }
}
