//! Errors of the folder of a run.

use std::path::{Path, PathBuf};

use crate::domain::DomainError;
use crate::region::RegionError;

/// Error of a run's folder.
#[derive(Debug, thiserror::Error)]
pub enum RunFolderError {
    /// A file operation failed.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// Other users could access the folder.
    #[error("{path} is {found}: the runs of a user must be private to them; {advice}", path = .path.display())]
    NotPrivate {
        /// The folder.
        path: PathBuf,
        /// State found.
        found: String,
        /// Advice, in one sentence.
        advice: String,
    },
    /// This version cannot read the plan.
    #[error("{path} is not a plan of this version of motorium: {reason}")]
    Plan {
        /// The plan's file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The control block is unusable.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// The domain is unusable.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

/// Adds the path to an error of the file system.
pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> RunFolderError {
    let path = path.to_path_buf();
    move |source| RunFolderError::Io { path, source }
}
