//! Topics and images of a recording.

use motorium::state::TypeLayout;

use crate::foxglove::Derived;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedTopic {
    /// Name of the topic.
    pub name: String,
    /// Layout of the samples.
    pub layout: TypeLayout,
    /// Number of samples in the file.
    pub samples: u64,
    pub(super) derived: Derived,
}

/// Images of a camera in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPictures {
    /// Name of the topic with the images.
    pub topic: String,
    /// Name of the channel in the file. Its messages are `foxglove.RawImage`.
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
    /// Returns the decoder of the topic's exact channel.
    pub fn derived(&self) -> &Derived {
        &self.derived
    }
}
