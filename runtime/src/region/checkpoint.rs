//! Memory for a component's state that outlives a crash of the component.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// Capacity of a checkpoint, bytes.
pub const CHECKPOINT_BYTES: usize = 4096;
const WORDS: usize = CHECKPOINT_BYTES / 8;

/// Two copies of a component's state: while one is written the other is whole, even if the writer dies.
#[derive(Debug)]
#[repr(C)]
pub struct CheckpointBlock {
    /// Number of saved checkpoints; the newest whole one is copy `saved % 2`.
    saved: AtomicU64,
    copies: [[AtomicU64; WORDS]; 2],
}

impl CheckpointBlock {
    /// Saves a checkpoint: 8-byte words, at most [`CHECKPOINT_BYTES`] in all. Returns false if it is too large.
    pub fn save(&self, words: impl ExactSizeIterator<Item = u64>) -> bool {
        if words.len() > WORDS {
            return false;
        }
        let next = self.saved.load(Relaxed).wrapping_add(1);
        let copy = &self.copies[(next % 2) as usize];
        words.zip(copy).for_each(|(word, cell)| cell.store(word, Relaxed));
        self.saved.store(next, Release);
        true
    }

    /// Loads the newest whole checkpoint, if there is one. Only the component itself, after a restart, calls it.
    pub fn load(&self, words: &mut [u64]) -> bool {
        let saved = self.saved.load(Acquire);
        if saved == 0 || words.len() > WORDS {
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

    fn empty() -> CheckpointBlock {
        CheckpointBlock {
            saved: AtomicU64::new(0),
            copies: [const { [const { AtomicU64::new(0) }; WORDS] }; 2],
        }
    }

    #[test]
    fn the_newest_checkpoint_is_the_one_that_comes_back() {
        let block = empty();
        let mut words = [0; 3];
        assert!(!block.load(&mut words));
        for round in 1..5 {
            assert!(block.save([round, round + 1, round + 2].into_iter()));
            assert!(block.load(&mut words));
            assert_eq!(words, [round, round + 1, round + 2]);
        }
    }

    #[test]
    fn a_checkpoint_that_does_not_fit_is_refused_and_the_old_one_stays() {
        let block = empty();
        assert!(block.save([7].into_iter()));
        assert!(!block.save(vec![0; WORDS + 1].into_iter()));
        let mut word = [0];
        assert!(block.load(&mut word));
        assert_eq!(word, [7]);
    }
}
