//! A single-writer latest-value buffer in shared memory, read in place: the state of a topic.
//!
//! # What it is
//! The memory of a topic holds a word that names the newest publication, a pin per reader, and as many slots
//! as pins and two more. A reader pins the slot of the newest value and uses it where it lies, as a plain
//! `&T` that does not change until the reader looks for the next one. The writer fills a slot that nobody has
//! pinned. Nobody copies, nobody waits, and the size of a value makes no difference to the cost of the
//! exchange.
//!
//! # When a process dies
//! A killed reader leaves one slot pinned until its successor takes the pin over: the writer still finds a
//! slot, since there is one for every pin. A killed writer leaves the last whole value, however far it had
//! got with the next.
//!
//! # Weakly ordered processors
//! [`protocol`] and [`notify`] are written once, generic over their atomics, and model-checked with loom
//! (`model`).
//!
//! # Every value
//! A [`Tap`] reads each publication in order from the slots behind the newest, at no cost to the writer. A
//! topic with a `history` keeps that many values for taps; what a tap misses is counted.

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
