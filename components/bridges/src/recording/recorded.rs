//! Topics and pictures of a recording.

use motorium::state::TypeLayout;

use crate::foxglove::Derived;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedTopic {
    /// Its name.
    pub name: String,
    /// Layout of its samples.
    pub layout: TypeLayout,
    /// Number of samples in the file.
    pub samples: u64,
    pub(super) derived: Derived,
}

/// Images of a camera in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPictures {
    /// Name of their topic.
    pub topic: String,
    /// Name of their channel in the file, whose messages are `foxglove.RawImage`.
    pub channel: String,
    /// Number of images in the file.
    pub count: u64,
}

/// The source of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// Index among the topics.
    Topic(usize),
    /// Index among the image topics.
    Pictures(usize),
}

impl RecordedTopic {
    /// Decoder of its exact channel.
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}
