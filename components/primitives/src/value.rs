//! Invalid numbers, vectors and matrices: errors shared by all models.

/// Error of a value that is out of range, has the wrong size, or is not finite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// A number is outside the valid range of the equations.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The quantity.
        name: &'static str,
        /// Value found.
        value: f64,
        /// Range expected.
        expected: &'static str,
    },
    /// A vector or matrix of the wrong size.
    #[error("{name} has {found} entries, expected {expected}")]
    Size {
        /// The quantity.
        name: &'static str,
        /// Value found.
        found: usize,
        /// Value expected.
        expected: usize,
    },
    /// NaN or an infinite value.
    #[error("{name} holds {value}, expected finite numbers only")]
    NotFinite {
        /// The quantity.
        name: &'static str,
        /// Value found.
        value: f64,
    },
}
