//! Numbers, vectors and matrices that will not do: what the errors of all models share.

/// An error of a value: out of its range, of the wrong size, or not finite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// A number is outside the range in which the equations hold.
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
