//! Episodes of a topic: a new one begins without publications.

use std::sync::atomic::Ordering::{Relaxed, Release};

use super::TopicMemory;
use super::protocol::Words as _;

impl TopicMemory {
    /// Episodes begun, as the component of this mapping has seen them.
    #[inline]
    pub(crate) fn era(&self) -> u32 {
        self.era.get()
    }

    /// Begins an episode for the component of this mapping: its readers drop what they hold.
    pub(crate) fn begin_era(&self) {
        self.era.set(self.era.get().wrapping_add(1));
    }

    /// Takes back all publications, for all: while nobody publishes, and nobody but taps reads.
    pub(crate) fn clear(&self) {
        (0..self.slots()).for_each(|slot| self.mark(slot).store(0, Relaxed));
        self.head().times.iter().for_each(|time| time.store(0, Relaxed));
        self.head().newest.store(0, Release);
    }
}
