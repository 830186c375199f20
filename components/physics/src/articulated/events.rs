//! Joints at their limits.

/// Numbers of joints at their limits at the end of an integration step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointEvents {
    /// Number of joints whose drive is at its effort limit.
    pub saturated: usize,
    /// Number of joints at a position limit.
    pub at_limit: usize,
}
