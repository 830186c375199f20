//! Loading of trained policies from disk, and checks that they fit a task.

use std::path::Path;

use motorium_models::policy::{PolicyFolder, PolicyFolderError, PolicyNetwork};

use crate::task::{Task, TaskError};

/// Error of a policy that does not fit a task.
#[derive(Debug, thiserror::Error)]
pub enum TrainedPolicyError {
    /// The policy folder cannot be read.
    #[error(transparent)]
    Folder(#[from] PolicyFolderError),
    /// The policy was trained for other observations or actions.
    #[error(
        "the {what} of the policy differ from the {what} of the task\n\
         help: use the policy on the task for which it was trained"
    )]
    Terms {
        /// Name of the terms that differ.
        what: &'static str,
    },
    /// The task is invalid.
    #[error(transparent)]
    Task(#[from] TaskError),
}

/// Loads the network of the policy in a folder and checks it for a task.
///
/// # Errors
///
/// [`TrainedPolicyError`].
pub(crate) fn load(folder: &Path, task: &Task) -> Result<PolicyNetwork, TrainedPolicyError> {
    let folder = PolicyFolder::read(folder)?;
    let (policy, expected) = (&folder.policy, task.policy()?);
    for (what, differ) in [
        ("observations", policy.observations != expected.observations),
        ("actions", policy.action != expected.action),
        ("rates", policy.rate != expected.rate),
    ] {
        if differ {
            return Err(TrainedPolicyError::Terms { what });
        }
    }
    Ok(folder.network()?)
}
