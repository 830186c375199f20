//! Numbers, vectors and matrices that will not do: what the errors of all models share.

/// What is wrong with a value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// A number is outside the range in which the equations hold.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The quantity.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// A vector or matrix of the wrong size.
    #[error("{name} has {found} entries, expected {expected}")]
    Size {
        /// The quantity.
        name: &'static str,
        /// What was found.
        found: usize,
        /// What was expected.
        expected: usize,
    },
    /// A number that is none.
    #[error("{name} holds {value}, expected finite numbers only")]
    NotFinite {
        /// The quantity.
        name: &'static str,
        /// What was found.
        value: f64,
    },
}
