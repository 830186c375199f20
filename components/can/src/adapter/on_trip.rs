//! Reaction to a trip.

/// Reaction of the remaining drives when a drive is lost or reports a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnTrip {
    /// The drives brake softly, with a position gain of zero and the velocity gain of the safe states. Drives
    /// that are controlled by position hold their current position.
    #[default]
    Damp,
    /// The drives are disabled.
    Disable,
}
