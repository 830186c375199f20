//! The atomic operations of the protocols in shared memory, so that each protocol is written once.
//!
//! [`Native`] uses the processor's atomics. The models in `runtime/src/model` run the same protocol code with
//! loom's atomics, which try every interleaving and every value that a weakly ordered processor may return. A
//! [`Site`] names each point at which a protocol relies on an ordering. A model can weaken one site at a time
//! and must then find a fault.

use core::fmt::Debug;
use std::sync::atomic::Ordering::{self, Relaxed, Release, SeqCst};

/// A point in a protocol whose memory ordering matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Site {
    /// A writer announces the value in a slot as the newest one.
    Publish,
    /// A writer stores the publication of a slot, for taps.
    Mark,
    /// A writer has cleared the mark of a slot and is about to check the pins.
    Claim,
    /// A writer reads the pins.
    Scan,
    /// A reader pins a slot, and thereby releases the slot that it pinned before.
    Pin,
    /// A reader has pinned a slot and is about to check that the slot still contains the newest value.
    Pinned,
    /// A reader checks for the newest value.
    Look,
    /// A writer has published and is about to check for sleepers.
    Notify,
    /// A waiter has registered as sleeping and is about to check for a publication again.
    Sleep,
    /// A writer stores the time of a publication.
    Time,
    /// A waiter has read a time and is about to check that the time belongs to the newest publication.
    TimeRead,
    /// A component completes a checkpoint.
    Save,
    /// A restarted component looks for the complete checkpoint.
    Load,
    /// A writer has entered a slot of a ring and is about to change the record.
    Enter,
    /// A writer leaves a slot of a ring with a complete record.
    Leave,
    /// A reader checks whether a slot of a ring contains a complete record.
    Begin,
    /// A reader has read a record and is about to check whether the slot was entered meanwhile.
    Confirm,
}

/// An unsigned number shared by several threads or processes.
pub(crate) trait Word<V: Copy>: Debug {
    /// Creates a word with this value. Words in shared memory start as zero bytes instead.
    #[cfg(test)]
    fn new(value: V) -> Self;
    /// Reads the word.
    fn load(&self, ordering: Ordering) -> V;
    /// Writes the word.
    fn store(&self, value: V, ordering: Ordering);
    /// Atomically replaces the word and returns the previous value.
    fn swap(&self, value: V, ordering: Ordering) -> V;
    /// Adds, wrapping; returns the previous value.
    fn fetch_add(&self, value: V, ordering: Ordering) -> V;
    /// Subtracts, wrapping; returns the previous value.
    fn fetch_sub(&self, value: V, ordering: Ordering) -> V;
    /// Writes `new` if the word equals `current`; returns `true` if it did.
    fn replace(&self, current: V, new: V) -> bool;
}

/// A family of atomic types and their fences.
pub(crate) trait Atomics: Debug + 'static {
    /// A word of 32 bits.
    type U32: Word<u32>;
    /// A word of 64 bits.
    type U64: Word<u64>;

    /// Returns the memory ordering at a site: `strong` unless a model weakens it.
    fn ordering(site: Site, strong: Ordering) -> Ordering;

    /// Issues a sequentially consistent fence.
    fn fence(site: Site);

    /// Issues a sequentially consistent fence after a [`swap`](Word::swap) or addition of the same thread,
    /// which alone may be sufficient.
    #[inline(always)]
    fn fence_after_exchange(site: Site) {
        Self::fence(site);
    }

    /// Issues a fence that orders earlier reads before later reads.
    fn read_fence(site: Site);

    /// Stores with release ordering at `site`, followed by the fence at `fence`.
    #[inline(always)]
    fn store_fenced(word: &Self::U32, value: u32, site: Site, fence: Site) {
        word.store(value, Self::ordering(site, Release));
        Self::fence(fence);
    }
}

/// The processor's atomics.
#[derive(Debug)]
pub(crate) enum Native {}

macro_rules! native {
    ($($value:ty => $word:ty),*) => { $(
        impl Word<$value> for $word {
            #[cfg(test)]
            fn new(value: $value) -> Self {
                Self::new(value)
            }

            #[inline(always)]
            fn load(&self, ordering: Ordering) -> $value {
                self.load(ordering)
            }

            #[inline(always)]
            fn store(&self, value: $value, ordering: Ordering) {
                self.store(value, ordering);
            }

            #[inline(always)]
            fn swap(&self, value: $value, ordering: Ordering) -> $value {
                self.swap(value, ordering)
            }

            #[inline(always)]
            fn fetch_add(&self, value: $value, ordering: Ordering) -> $value {
                self.fetch_add(value, ordering)
            }

            #[inline(always)]
            fn fetch_sub(&self, value: $value, ordering: Ordering) -> $value {
                self.fetch_sub(value, ordering)
            }

            #[inline(always)]
            fn replace(&self, current: $value, new: $value) -> bool {
                self.compare_exchange(current, new, SeqCst, Relaxed).is_ok()
            }
        }
    )* };
}
native!(u32 => core::sync::atomic::AtomicU32, u64 => core::sync::atomic::AtomicU64);

impl Atomics for Native {
    type U32 = core::sync::atomic::AtomicU32;
    type U64 = core::sync::atomic::AtomicU64;

    #[inline(always)]
    fn ordering(_: Site, strong: Ordering) -> Ordering {
        strong
    }

    #[inline(always)]
    fn fence(_: Site) {
        core::sync::atomic::fence(SeqCst);
    }

    #[inline(always)]
    fn read_fence(_: Site) {
        core::sync::atomic::fence(Ordering::Acquire);
    }

    // An exchange is a full barrier on x86, at half the cost of a store and a fence.
    #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
    #[inline(always)]
    fn fence_after_exchange(_: Site) {
        core::sync::atomic::compiler_fence(SeqCst);
    }

    #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
    #[inline(always)]
    fn store_fenced(word: &Self::U32, value: u32, _: Site, _: Site) {
        word.swap(value, SeqCst);
        core::sync::atomic::compiler_fence(SeqCst);
    }
}
