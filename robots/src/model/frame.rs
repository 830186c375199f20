//! Named frames: one for every URDF link.

use nalgebra::Isometry3;

use super::Inertia;
use crate::nearest::suggestion;

/// Index of a frame in [`Model::frames`](crate::Model::frames). Look up the frame once, outside loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FrameId(pub(crate) usize);

impl FrameId {
    /// Returns the index in [`Model::frames`](crate::Model::frames).
    pub fn index(self) -> usize {
        self.0
    }
}

/// The frame of a URDF link.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name of the link.
    pub name: String,
    /// Index of the body to which the frame is fixed; `None` for the base or the world.
    pub body: Option<usize>,
    /// `true` if the frame is fixed to the world next to a floating base, such as a link above a `floating`
    /// joint.
    pub in_world: bool,
    /// Pose of this frame relative to the frame of its body or, for a frame without a body, of the base or
    /// the world.
    pub placement: Isometry3<f64>,
    /// Frame index of the parent link, to which this link is connected by a joint of any type; `None` for a
    /// root.
    pub parent: Option<usize>,
    /// Inertia of this link alone, in its frame.
    pub inertia: Inertia,
}

/// Error of naming a link that the robot does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("robot \"{robot}\" has no link \"{name}\"{}", suggestion(.nearest.as_deref()))]
pub struct UnknownFrame {
    /// The requested name.
    pub name: String,
    /// Name of the robot.
    pub robot: String,
    /// The closest existing link.
    pub nearest: Option<String>,
}
