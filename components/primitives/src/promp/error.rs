//! Errors of probabilistic primitives.

use crate::ValueError;

/// An error of creating or conditioning a primitive.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProMpError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// Too few demonstrations to estimate the variation.
    #[error("{found} demonstrations, expected at least 2: a covariance needs more than one; record another")]
    TooFew {
        /// Value found.
        found: usize,
    },
    /// A matrix is not a covariance.
    #[error("{name} is not positive definite: give it a larger variance, or the fit a larger jitter")]
    NotPositive {
        /// The matrix.
        name: &'static str,
    },
    /// The primitives are incompatible.
    #[error(
        "the primitives differ in their basis or number of dimensions, so their weights cannot be combined"
    )]
    Different,
}
