//! Streams: every value, in order, through the queues of iceoryx2.

mod pool_allocated;
mod reader;
mod slices;
mod variant;
mod writer;

pub(crate) use reader::{StreamReader, Taken};
pub use slices::{SliceInput, SliceLoan, SliceOutput};
pub use variant::Shared;
pub(crate) use writer::{Lent, StreamWriter};
