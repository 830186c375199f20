//! Errors of imitation.

use crate::environment::EnvironmentError;

/// Error of imitation learning.
#[derive(Debug, thiserror::Error)]
pub enum ImitationError {
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The loss is not finite.
    #[error(
        "iteration {iteration}: the loss is {loss}, expected a finite number\n\
         help: lower `rate` or clip the observations of the task"
    )]
    NotFinite {
        /// Number of the iteration.
        iteration: u64,
        /// Value of the loss.
        loss: f64,
    },
}
