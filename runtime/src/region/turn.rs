//! The turn of lockstep: the right to step, held by one component or by the launcher at a time.
//!
//! The launcher passes the turn to the first component of a round. After its step, each holder passes the
//! turn to the next due component, in this round or the next, without waking the launcher. A holder that may
//! not continue returns the turn to the launcher. If a process dies while it holds the turn, the launcher
//! detects the death and takes the turn back.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::time::Duration;

use crate::os::{futex_wait, futex_wake};

/// The current turn of a run. Written by the holder of the turn, or by the launcher in place of a dead
/// holder.
#[derive(Debug, Default)]
#[repr(C)]
pub struct TurnBlock {
    /// Number of the turn in the upper half, then the giver and the holder, 16 bits each: 0 for the launcher,
    /// otherwise the index of a component plus 1.
    word: AtomicU64,
    /// Simulated time before which rounds may start without the launcher, ns.
    until_ns: AtomicU64,
    /// Number of further rounds that may start without the launcher.
    rounds_left: AtomicU64,
    /// Number of times that the launcher was called. The launcher sleeps on this word.
    called: AtomicU32,
}

/// A turn: its number, giver and holder. Giver and holder are the index of a component, or `None` for the
/// launcher.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Turn {
    number: u32,
    pub(crate) giver: Option<usize>,
    pub(crate) holder: Option<usize>,
}

impl Turn {
    fn from_word(word: u64) -> Self {
        let party = |bits: u64| ((bits & 0xffff) as usize).checked_sub(1);
        Self { number: (word >> 32) as u32, giver: party(word >> 16), holder: party(word) }
    }

    fn word(self) -> u64 {
        let bits = |party: Option<usize>| party.map_or(0, |index| (index as u64 + 1) & 0xffff);
        u64::from(self.number) << 32 | bits(self.giver) << 16 | bits(self.holder)
    }
}

impl TurnBlock {
    /// Returns the current turn.
    #[inline]
    pub(crate) fn now(&self) -> Turn {
        Turn::from_word(self.word.load(Acquire))
    }

    /// Passes the turn to `holder`, which the caller must wake separately. Only the current holder may call
    /// it.
    #[inline]
    pub(crate) fn pass(&self, giver: Option<usize>, holder: Option<usize>) {
        let number = self.now().number.wrapping_add(1);
        self.word.store(Turn { number, giver, holder }.word(), Release);
    }

    /// Returns the turn to the launcher and wakes it.
    pub(crate) fn give_back(&self, giver: usize) {
        self.pass(Some(giver), None);
        self.called.fetch_add(1, Release);
        futex_wake(&self.called);
    }

    /// Sleeps until the launcher is called or the timeout, unless the launcher has the turn.
    pub(crate) fn await_call(&self, timeout: Duration) {
        let called = self.called.load(Acquire);
        if self.now().holder.is_some() {
            futex_wait(&self.called, called, Some(timeout));
        }
    }

    /// Allows up to `rounds` rounds before simulated time `until_ns` to start without the launcher.
    pub(crate) fn allow_rounds(&self, until_ns: u64, rounds: u64) {
        self.until_ns.store(until_ns, Relaxed);
        self.rounds_left.store(rounds, Relaxed);
    }

    /// Returns `true` if the round at simulated time `round_ns` may start without the launcher.
    #[inline]
    pub(crate) fn may_begin(&self, round_ns: u64) -> bool {
        round_ns < self.until_ns.load(Relaxed) && self.rounds_left.load(Relaxed) > 0
    }

    /// Counts a round that starts without the launcher.
    #[inline]
    pub(crate) fn begin_round(&self) {
        self.rounds_left.store(self.rounds_left.load(Relaxed).saturating_sub(1), Relaxed);
    }

    /// Returns the number of further rounds that may start without the launcher.
    pub(crate) fn rounds_left(&self) -> u64 {
        self.rounds_left.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_turn_is_distinct_and_has_one_holder() {
        let block = TurnBlock::default();
        assert_eq!((block.now().giver, block.now().holder), (None, None), "at the start the launcher has it");
        block.pass(None, Some(511));
        let first = block.now();
        assert_eq!((first.giver, first.holder), (None, Some(511)));
        block.pass(Some(511), Some(511));
        assert_ne!(block.now(), first, "the same party again is another turn");
        block.give_back(511);
        assert_eq!((block.now().giver, block.now().holder), (Some(511), None));
        block.await_call(Duration::from_secs(60)); // returns immediately, because the launcher has it
    }

    #[test]
    fn rounds_are_limited_by_time_and_number() {
        let block = TurnBlock::default();
        assert!(!block.may_begin(0));
        block.allow_rounds(10, 2);
        assert!(block.may_begin(9) && !block.may_begin(10));
        block.begin_round();
        block.begin_round();
        assert!(!block.may_begin(0));
        assert_eq!(block.rounds_left(), 0);
    }
}
