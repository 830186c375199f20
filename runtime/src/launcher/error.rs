//! Errors of a launch.

use std::path::PathBuf;

use crate::domain::{DomainError, ServiceError};
use crate::run_folder::RunFolderError;
use crate::transport::PortError;

/// Error of launching a run.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// The folder or the control block of the run could not be created.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The iceoryx2 domain of the run could not be joined.
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
        /// Name of the component.
        name: String,
        /// Path of the component's program.
        program: PathBuf,
        /// Error of the operating system.
        reason: String,
    },
    /// A component failed before the start of the graph.
    #[error("component `{name}` did not start: {reason}")]
    Component {
        /// Name of the component.
        name: String,
        /// The component's error, or the cause of its end.
        reason: String,
    },
    /// The machine or the process lacks a resource. Nothing was created.
    #[error("{what}: the graph needs {need}, but {found}; {advice}")]
    Exhausted {
        /// The resource that is short.
        what: &'static str,
        /// The amount that the graph needs.
        need: String,
        /// The available amount, as a clause at the end of the message.
        found: String,
        /// Advice in one sentence.
        advice: String,
    },
    /// The system denied an operation that the launcher needs.
    #[error("{what}: {reason}")]
    System {
        /// The operation that was denied.
        what: &'static str,
        /// Error of the operating system.
        reason: String,
    },
    /// The graph cannot run with the requested options. Nothing was created.
    #[error("{what}: {reason}; {advice}")]
    Unsuitable {
        /// The requested option.
        what: String,
        /// Reason why the graph cannot run with this option.
        reason: String,
        /// Advice in one sentence.
        advice: &'static str,
    },
}
