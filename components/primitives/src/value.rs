//! Invalid numbers, vectors and matrices: errors shared by all models.

/// Error returned when a value is out of range, has the wrong size, or is not finite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// A number is outside the valid range of the equations.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// Name of the quantity.
        name: &'static str,
        /// Value found.
        value: f64,
        /// Description of the valid range.
        expected: &'static str,
    },
    /// A vector or matrix has the wrong size.
    #[error("{name} has {found} entries, expected {expected}")]
    Size {
        /// Name of the quantity.
        name: &'static str,
        /// Size found.
        found: usize,
        /// Size expected.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("{name} contains {value}, expected only finite numbers")]
    NotFinite {
        /// Name of the quantity.
        name: &'static str,
        /// Value found.
        value: f64,
    },
}
