//! Errors of a measurement.

use motorium::session::SessionError;
use motorium::testing::TopicSetError;

/// A failed measurement.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The system refused an operation.
    #[error("{what} failed: {reason}")]
    System {
        /// Description of the attempted operation.
        what: &'static str,
        /// Error of the system.
        reason: String,
    },
    /// The graph of a measurement cannot run here.
    #[error("the graph of the measurement cannot run on this machine: {0}")]
    Graph(String),
    /// The topics of a measurement could not be created.
    #[error(transparent)]
    Topics(#[from] TopicSetError),
    /// The graph of a measurement did not start.
    #[error(transparent)]
    Launch(#[from] SessionError),
    /// A process of the measurement failed.
    #[error("the process `{process}` of the measurement failed: {reason}")]
    Process {
        /// Name of the failed process.
        process: &'static str,
        /// Last message of the process.
        reason: String,
    },
    /// The graph of a measurement ended early.
    #[error("the graph of the measurement ended early: {0}")]
    Ended(String),
    /// Steps of a component allocated heap memory, which they must not.
    #[error("steps of `{component}` made {count} allocations, expected none")]
    Allocations {
        /// Name of the component in the graph.
        component: String,
        /// Number of allocations after the first 100 steps.
        count: u64,
    },
    /// Values of a queue were not read.
    #[error("{lost} values were lost and {read} were read, expected no loss")]
    Lost {
        /// Number of missing values.
        lost: u64,
        /// Number of values read.
        read: u64,
    },
    /// The user interrupted the measurement.
    #[error("interrupted")]
    Interrupted,
    /// The measurement has a requirement, given as text, that the machine lacks.
    #[error("the measurement requires {0}")]
    Needs(&'static str),
}

impl MeasureError {
    pub(crate) fn system(what: &'static str, error: impl core::fmt::Display) -> Self {
        Self::System { what, reason: error.to_string() }
    }
}
