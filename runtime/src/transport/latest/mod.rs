//! A single-writer latest-value buffer in shared memory, read in place, for the state of a topic.
//!
//! # Overview
//! The memory of a topic consists of a word that identifies the newest publication, one pin per reader, and
//! slots for values, two more than pins. A reader pins the slot of the newest value and uses the value in
//! place, as a plain `&T` that does not change until the reader pins the next slot. The writer fills an
//! unpinned slot. Nothing is copied, no process waits, and the cost of an exchange does not depend on the
//! size of the value.
//!
//! # Process crashes
//! A killed reader leaves one slot pinned until its successor takes over the pin. The writer nevertheless
//! finds a free slot, because there are more slots than pins. A killed writer leaves the last complete value,
//! no matter how much of the next value it had written.
//!
//! # Weakly ordered processors
//! [`protocol`] and [`notify`] are written once, generic over their atomics, and model-checked with loom
//! (`model`).
//!
//! A [`Tap`] reads every publication in order, from slots that still contain older values, at no cost to the
//! writer. A topic with a `history` keeps that many values for taps. Publications that a tap misses are
//! counted.

mod dimensions;
mod memory;
pub(crate) mod notify;
pub(crate) mod protocol;
mod reader;
mod tap;
mod writer;

pub(crate) use dimensions::SIDE_PINS;
pub(crate) use memory::TopicMemory;
pub(crate) use reader::StateReader;
pub(crate) use tap::Tap;
pub(crate) use writer::StateWriter;
