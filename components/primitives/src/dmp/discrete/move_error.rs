//! Errors of starting and steering a movement.

use crate::dmp::Variant;

/// Error returned when a movement cannot be started or steered. The movement is left unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MoveError {
    /// A vector's length differs from the number of dimensions.
    #[error("{name} has {found} entries, expected {expected}, one per dimension of the primitive")]
    Dimensions {
        /// Name of the vector.
        name: &'static str,
        /// Length found.
        found: usize,
        /// Number of dimensions of the model.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("{name} contains {value}, expected only finite numbers")]
    NotFinite {
        /// Name of the vector.
        name: &'static str,
        /// Value found.
        value: f64,
    },
    /// The duration is not a positive time.
    #[error("a duration of {found} s, expected a positive time")]
    Duration {
        /// Value found, s.
        found: f64,
    },
    /// The variant ends at rest and therefore accepts no final velocity.
    #[error(
        "a primitive of the variant {} ends at rest: only the variant final_velocity accepts a final velocity",
        .variant.name()
    )]
    EndsAtRest {
        /// Variant of the primitive.
        variant: Variant,
    },
    /// The settings of the new model differ from the settings of the running model.
    #[error(
        "the settings of the new model differ from the current settings: only weights can be exchanged at run time"
    )]
    OtherSettings,
}
