//! Errors of a launch.

use std::path::PathBuf;

use crate::domain::{DomainError, ServiceError};
use crate::run_folder::RunFolderError;
use crate::transport::PortError;

/// Error of a launch.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// The run's folder or control block could not be created.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The run's domain could not be joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A topic or parameter could not be created.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The service of a topic or of parameters could not be created.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// A process could not be started.
    #[error("component `{name}`: {program} could not be started: {reason}")]
    Start {
        /// The component.
        name: String,
        /// Its program.
        program: PathBuf,
        /// The error of the system.
        reason: String,
    },
    /// A component failed before the start of the graph.
    #[error("component `{name}` did not start: {reason}")]
    Component {
        /// The component.
        name: String,
        /// Its error, or the kind of its end.
        reason: String,
    },
    /// A resource of this machine or process is insufficient. Nothing was created.
    #[error("{what}: the graph needs {need}, but {found}; {advice}")]
    Exhausted {
        /// The shortage.
        what: &'static str,
        /// The amount that the graph needs.
        need: String,
        /// Available amount, as a clause.
        found: String,
        /// Advice, in one sentence.
        advice: String,
    },
    /// The system denied an operation that the launcher needs.
    #[error("{what}: {reason}")]
    System {
        /// The attempted operation.
        what: &'static str,
        /// The error of the system.
        reason: String,
    },
    /// The graph cannot run with the requested options. Nothing was created.
    #[error("{what}: {reason}; {advice}")]
    Unsuitable {
        /// Requested value.
        what: String,
        /// Reason for the rejection.
        reason: String,
        /// Advice, in one sentence.
        advice: &'static str,
    },
}
