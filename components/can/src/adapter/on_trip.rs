//! Reaction to a trip.

/// Reaction of the other drives when one is lost or reports a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnTrip {
    /// The drives brake softly: no position gain, and the velocity gain of the safe states.
    /// Position-controlled drives hold their current position.
    #[default]
    Damp,
    /// The drives are disabled.
    Disable,
}
