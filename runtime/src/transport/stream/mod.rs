//! Streams: every value, in order, through the queues of iceoryx2.

mod reader;
mod sample;
mod service;
mod slices;
mod writer;

pub(crate) use reader::StreamReader;
pub(crate) use sample::{Queue, Received, parts, receive};
pub(crate) use service::open_queue;
pub(super) use service::{Samples, builder, layout_attribute};
pub use slices::{SliceInput, SliceLoan, SliceOutput};
pub(crate) use writer::{Lent, StreamWriter};

/// A port whose connections can be made before the first step.
pub(crate) trait Connect {
    fn connect(&self) -> Result<(), String>;

    /// Drops values of the previous episode.
    fn begin_episode(&self) {}
}
