//! Memory for a component's state that survives a crash of the component.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use crate::atomics::{Atomics, Native, Site, Word};

/// Capacity of a checkpoint, bytes.
pub const CHECKPOINT_BYTES: usize = 4096;
const WORDS: usize = CHECKPOINT_BYTES / 8;

/// Saved state of a component in the control block of the run.
pub(crate) type CheckpointBlock = Checkpoints<Native, WORDS>;

/// A double buffer of saved numbers with one writer. While one copy is written, the other is complete, so the
/// writer may be killed at any time.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Checkpoints<A: Atomics, const N: usize> {
    /// Number of checkpoints saved so far. The newest complete one is in copy `saved % 2`.
    saved: A::U64,
    copies: [[A::U64; N]; 2],
}

impl<A: Atomics, const N: usize> Checkpoints<A, N> {
    /// Creates an empty checkpoint.
    #[cfg(test)]
    pub(crate) fn empty() -> Self {
        let copy = || core::array::from_fn(|_| A::U64::new(0));
        Self { saved: A::U64::new(0), copies: [copy(), copy()] }
    }

    /// Saves a checkpoint of at most `N` words. Returns `false` without saving if there are more.
    pub(crate) fn save(&self, words: impl ExactSizeIterator<Item = u64>) -> bool {
        if words.len() > N {
            return false;
        }
        let next = self.saved.load(Relaxed).wrapping_add(1);
        let copy = &self.copies[(next % 2) as usize];
        words.zip(copy).for_each(|(word, cell)| cell.store(word, Relaxed));
        self.saved.store(next, A::ordering(Site::Save, Release));
        true
    }

    /// Deletes the saved checkpoints.
    pub(crate) fn forget(&self) {
        self.saved.store(0, A::ordering(Site::Save, Release));
    }

    /// Reads the newest complete checkpoint into `words`, at most `N` words. Returns `false` if none has been
    /// saved. Only the component itself reads it, after a restart.
    pub(crate) fn load(&self, words: &mut [u64]) -> bool {
        let saved = self.saved.load(A::ordering(Site::Load, Acquire));
        if saved == 0 || words.len() > N {
            return false;
        }
        let copy = &self.copies[(saved % 2) as usize];
        words.iter_mut().zip(copy).for_each(|(word, cell)| *word = cell.load(Relaxed));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newest_checkpoint_is_loaded() {
        let block = CheckpointBlock::empty();
        let mut words = [0; 3];
        assert!(!block.load(&mut words));
        for round in 1..5 {
            assert!(block.save([round, round + 1, round + 2].into_iter()));
            assert!(block.load(&mut words));
            assert_eq!(words, [round, round + 1, round + 2]);
        }
    }

    #[test]
    fn oversized_checkpoint_is_rejected_and_the_old_one_kept() {
        let block = CheckpointBlock::empty();
        assert!(block.save([7].into_iter()));
        assert!(!block.save(vec![0; WORDS + 1].into_iter()));
        let mut word = [0];
        assert!(block.load(&mut word));
        assert_eq!(word, [7]);
    }
}
