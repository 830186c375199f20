//! Declared ports.

use serde::{Deserialize, Serialize};

use crate::state::TypeLayout;

/// The direction of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Reads.
    Input,
    /// Writes.
    Output,
}

/// The pattern by which a topic carries its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TopicPattern {
    /// State: the newest value; older ones are gone.
    State,
    /// Stream: a queue per reader; on overflow the oldest samples are dropped and counted.
    Stream {
        /// Number of samples a reader may lag behind before it loses the oldest.
        capacity: usize,
    },
    /// A queue of this many slices per reader, each of another length.
    Slices {
        /// Number of slices a reader may lag behind before it loses the oldest.
        capacity: usize,
        /// Elements of the longest slice. An input declares 0, since the topic's writer defines it.
        longest: usize,
    },
}

impl TopicPattern {
    /// Returns the capacity of the queue in samples or slices; `None` for a state.
    pub fn capacity(self) -> Option<usize> {
        match self {
            Self::State => None,
            Self::Stream { capacity } | Self::Slices { capacity, .. } => Some(capacity),
        }
    }
}

/// A declared port.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortDeclaration {
    /// Name of the port in the component's `subscribe` or `publish` table.
    pub name: String,
    /// Reads or writes.
    pub direction: Direction,
    /// State or stream.
    pub pattern: TopicPattern,
    /// Layout of its samples.
    pub layout: TypeLayout,
    /// True if the graph must wire it.
    pub required: bool,
    /// One line of explanation.
    pub doc: String,
}
