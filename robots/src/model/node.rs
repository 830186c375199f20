//! Bodies in the form used by the recursions.

use crate::math::{M3, RigidInertia, V3};

/// One body and the joint above it, in the form used by the recursions.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// Node frame at joint position zero, in the parent's node frame.
    pub(crate) rotation: M3,
    pub(crate) translation: V3,
    /// Inertia about the origin of the node frame, in its axes.
    pub(crate) inertia: RigidInertia,
    /// Index of the parent in a workspace: 0 is the base, body `i` is `i + 1`.
    pub(crate) parent: usize,
    /// `true` if the joint translates along z instead of rotating about it.
    pub(crate) prismatic: bool,
    /// Column of `v`.
    pub(crate) column: usize,
    /// Joint position = multiplier * q\[place\] + offset.
    pub(crate) place: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
    /// Rotor inertia as seen by the column of `v`.
    pub(crate) armature: f64,
}

impl Node {
    /// Returns the node frame in the parent's, for a joint position with this sine and cosine.
    #[inline(always)]
    pub(crate) fn pose(&self, (x, sin, cos): (f64, f64, f64)) -> (M3, V3) {
        if self.prismatic {
            (self.rotation, self.translation + self.rotation.z * x)
        } else {
            (self.rotation.turned(sin, cos), self.translation)
        }
    }
}
