//! Errors of starting and steering a movement.

use crate::dmp::Variant;

/// An error of starting or steering a movement, which leaves it unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MoveError {
    /// A vector of another length than the model has dimensions.
    #[error("{name} has {found} entries, the primitive {expected} dimensions")]
    Dimensions {
        /// The vector.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The dimensions of the model.
        expected: usize,
    },
    /// NaN or an infinite value.
    #[error("{name} holds {value}, expected finite numbers only")]
    NotFinite {
        /// The vector.
        name: &'static str,
        /// Value found.
        value: f64,
    },
    /// A duration that is not a positive time.
    #[error("a duration of {found} s, expected a positive time")]
    Duration {
        /// Value found, s.
        found: f64,
    },
    /// A final velocity for a variant that ends at rest.
    #[error(
        "a primitive of the variant {} ends at rest: one of the variant final_velocity takes a final velocity",
        .variant.name()
    )]
    EndsAtRest {
        /// The variant.
        variant: Variant,
    },
    /// A model that was made with other settings.
    #[error("the other model has other settings: only weights can be exchanged while it runs")]
    OtherSettings,
}
