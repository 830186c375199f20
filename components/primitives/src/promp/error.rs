//! Errors of probabilistic primitives.

use crate::ValueError;

/// Error returned when a probabilistic primitive cannot be created, conditioned or combined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProMpError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// There are too few demonstrations to estimate the variation.
    #[error(
        "found {found} demonstrations, expected at least 2 to estimate a covariance; record another demonstration"
    )]
    TooFew {
        /// Number of demonstrations found.
        found: usize,
    },
    /// A covariance is not positive definite.
    #[error("{name} is not positive definite: increase its variance, or the jitter of the fit")]
    NotPositive {
        /// Name of the matrix.
        name: &'static str,
    },
    /// The primitives have different bases or numbers of dimensions and cannot be combined.
    #[error(
        "the primitives differ in their basis or number of dimensions, so their weights cannot be combined"
    )]
    Different,
}
