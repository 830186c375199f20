//! Declared ports.

use serde::{Deserialize, Serialize};

use crate::state::TypeLayout;

/// The direction of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// The component reads a topic.
    Input,
    /// The component writes a topic.
    Output,
}

/// Delivery pattern of a topic: state, stream or slices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TopicPattern {
    /// State: readers see only the newest value.
    State,
    /// Stream: one queue per reader. A full queue drops its oldest sample and counts the loss.
    Stream {
        /// Capacity of each queue: the number of samples by which a reader may lag behind without losing any.
        capacity: usize,
    },
    /// Slices: one queue per reader, as for a stream, but each sample is an array of varying length.
    Slices {
        /// Capacity of each queue: the number of slices by which a reader may lag behind without losing any.
        capacity: usize,
        /// Maximum number of elements per slice. An input declares 0, because the topic's writer defines the
        /// maximum.
        longest: usize,
    },
}

impl TopicPattern {
    /// Returns the capacity of each queue in samples or slices; `None` for a state.
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
    /// Direction of the data: input or output.
    pub direction: Direction,
    /// Delivery pattern: state, stream or slices.
    pub pattern: TopicPattern,
    /// Layout of the samples.
    pub layout: TypeLayout,
    /// True if the graph must wire the port.
    pub required: bool,
    /// One-line description, which is shown in lists of ports.
    pub doc: String,
}
