//! Errors of the folder of a run.

use std::path::{Path, PathBuf};

use crate::domain::DomainError;
use crate::region::RegionError;

/// Error of accessing the folder of a run.
#[derive(Debug, thiserror::Error)]
pub enum RunFolderError {
    /// A file operation failed.
    #[error("{path}: {source}")]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The folder is not private: other users could access it.
    #[error("{path} is {found}, expected a folder that only this user can access; {advice}", path = .path.display())]
    NotPrivate {
        /// Path of the folder.
        path: PathBuf,
        /// Type, owner or permissions of the folder, as found.
        found: String,
        /// Advice in one sentence.
        advice: String,
    },
    /// The plan was written by a version of motorium other than this one, or is damaged.
    #[error("{path} is not a plan of this version of motorium: {reason}")]
    Plan {
        /// Path of the plan.
        path: PathBuf,
        /// Reason why the plan cannot be read.
        reason: String,
    },
    /// The control block cannot be created or mapped.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// The iceoryx2 domain cannot be created or joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

/// Adds the path to an error of the file system.
pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> RunFolderError {
    let path = path.to_path_buf();
    move |source| RunFolderError::Io { path, source }
}
