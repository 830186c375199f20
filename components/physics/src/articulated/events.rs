//! Joints at their limits.

/// Counts of joints on a limit at the end of an integration step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointEvents {
    /// Joints whose drive is at its effort limit.
    pub saturated: usize,
    /// Joints held by a limit stop.
    pub at_limit: usize,
}
