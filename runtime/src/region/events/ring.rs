//! A wait-free ring of records in shared memory, with several writers and any number of readers.
//!
//! Records are numbered from 1, and the number of a record selects its slot. The state word of a slot is
//! twice the number of its record, plus one while the record is being written. A writer takes the next
//! number, enters the slot by exchanging its state, writes the words, and leaves the slot. A reader accepts a
//! record only if the state showed the same complete record before and after reading, so it never accepts a
//! torn record.
//!
//! The slot of a killed writer remains unusable. Other writers skip it with an empty number, which readers
//! count as lost.

use core::cmp::Ordering as Order;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use crate::atomics::{Atomics, Site, Word};

/// A ring of `SLOTS` records of `WORDS` words each. Zero bytes are an empty ring.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Ring<A: Atomics, const SLOTS: usize, const WORDS: usize> {
    /// Numbers taken by writers so far.
    taken: A::U64,
    slots: [Slot<A, WORDS>; SLOTS],
}

#[derive(Debug)]
#[repr(C)]
struct Slot<A: Atomics, const WORDS: usize> {
    state: A::U64,
    words: [A::U64; WORDS],
}

/// The outcome of reading a record by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    /// The complete record.
    Record,
    /// A later record has replaced it.
    Overwritten,
    /// The record is being written, was skipped by its writer, or was abandoned by a killed writer.
    Pending,
}

impl<A: Atomics, const SLOTS: usize, const WORDS: usize> Ring<A, SLOTS, WORDS> {
    /// Creates an empty ring.
    #[cfg(test)]
    pub(crate) fn empty() -> Self {
        let words = || core::array::from_fn(|_| A::U64::new(0));
        let slots = core::array::from_fn(|_| Slot { state: A::U64::new(0), words: words() });
        Self { taken: A::U64::new(0), slots }
    }

    /// Returns the number of the newest record.
    pub(crate) fn newest(&self) -> u64 {
        self.taken.load(Relaxed)
    }

    /// Writes a record over the oldest one. Returns `false` without writing if other writers occupy all
    /// slots.
    pub(crate) fn write(&self, words: &[u64; WORDS]) -> bool {
        for _ in 0..SLOTS {
            let number = self.taken.fetch_add(1, Relaxed).wrapping_add(1);
            let (slot, whole) = (self.slot(number), number.wrapping_mul(2));
            let state = slot.state.load(Relaxed);
            let is_entered = state % 2 == 1;
            if is_entered || state >= whole || !slot.state.replace(state, whole + 1) {
                continue;
            }
            A::fence(Site::Enter);
            words.iter().zip(&slot.words).for_each(|(word, cell)| cell.store(*word, Relaxed));
            slot.state.store(whole, A::ordering(Site::Leave, Release));
            return true;
        }
        false
    }

    /// Reads the record with a number into `words`.
    pub(crate) fn read(&self, number: u64, words: &mut [u64; WORDS]) -> Found {
        let (slot, whole) = (self.slot(number), number.wrapping_mul(2));
        let state = slot.state.load(A::ordering(Site::Begin, Acquire));
        match state.cmp(&whole) {
            Order::Greater if state > whole + 1 => return Found::Overwritten,
            Order::Greater | Order::Less => return Found::Pending,
            Order::Equal => {}
        }
        words.iter_mut().zip(&slot.words).for_each(|(word, cell)| *word = cell.load(Relaxed));
        A::read_fence(Site::Confirm);
        if slot.state.load(Relaxed) == state { Found::Record } else { Found::Overwritten }
    }

    fn slot(&self, number: u64) -> &Slot<A, WORDS> {
        &self.slots[(number % SLOTS as u64) as usize]
    }

    /// Enters the slot of the next number and never leaves it, like a killed writer.
    #[cfg(test)]
    pub(crate) fn write_and_die(&self) {
        let number = self.taken.fetch_add(1, Relaxed) + 1;
        self.slot(number).state.store(2 * number + 1, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atomics::Native;

    type Small = Ring<Native, 4, 2>;

    fn found(ring: &Small, number: u64) -> Result<[u64; 2], Found> {
        let mut words = [0; 2];
        match ring.read(number, &mut words) {
            Found::Record => Ok(words),
            other => Err(other),
        }
    }

    #[test]
    fn newest_records_are_kept_and_older_ones_counted() {
        let ring = Small::empty();
        assert_eq!(found(&ring, 1), Err(Found::Pending));
        (1..=6).for_each(|value| assert!(ring.write(&[value, 10 * value])));
        assert_eq!(ring.newest(), 6);
        for number in [1, 2] {
            assert_eq!(found(&ring, number), Err(Found::Overwritten));
        }
        for number in 3..=6 {
            assert_eq!(found(&ring, number), Ok([number, 10 * number]));
        }
    }

    #[test]
    fn killed_writer_does_not_block_others() {
        let ring = Small::empty();
        assert!(ring.write(&[1, 1]));
        ring.write_and_die();
        (3..=5).for_each(|value| assert!(ring.write(&[value, value])));
        assert_eq!(found(&ring, 2), Err(Found::Pending));
        // The next record skips the occupied slot.
        assert!(ring.write(&[6, 6]));
        assert_eq!((ring.newest(), found(&ring, 7)), (7, Ok([6, 6])));
        assert_eq!(found(&ring, 6), Err(Found::Pending));
    }

    #[test]
    fn fully_occupied_ring_rejects_writes_quickly() {
        let ring = Small::empty();
        (0..4).for_each(|_| ring.write_and_die());
        assert!(!ring.write(&[1, 1]));
    }
}
