//! The bodies of a robot: its base, and one body for each joint.

use nalgebra::Isometry3;

use super::{Inertia, Joint, Shape};

/// The body moved by one joint: the child link of the joint, merged with all links fixed to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name of the joint's child link. The frame of this link is the body frame.
    pub name: String,
    /// Joint that moves the body.
    pub joint: Joint,
    /// Index of the parent body; `None` for the base.
    pub parent: Option<usize>,
    /// Inertia of all links of the body, in the body frame.
    pub inertia: Inertia,
    /// Collision geometry of all links of the body, in the body frame.
    pub shapes: Vec<Shape>,
}

/// Root of the kinematic tree: the root link, with all links fixed to it merged.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// `true` for a floating base, which has six entries of `v` and seven of `q`, before the joints.
    pub floating: bool,
    /// Pose of the base in the world in the neutral configuration: the pose in the robot's file or, if the
    /// file has none, the identity.
    pub neutral: Isometry3<f64>,
    /// Inertia in the frame of the base's first link. Unused for a fixed base.
    pub inertia: Inertia,
    /// Collision geometry in the frame of the base's first link.
    pub shapes: Vec<Shape>,
    /// Collision geometry fixed to the world next to a floating base.
    pub world_shapes: Vec<Shape>,
}
