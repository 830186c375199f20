//! The bodies of a robot: its base, and one body for each joint.

use nalgebra::Isometry3;

use super::{Inertia, Joint, Shape};

/// The body moved by one joint, with every link fixed to it merged in.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// URDF child link of the joint; its frame is the body frame.
    pub name: String,
    /// Joint that moves the body.
    pub joint: Joint,
    /// Parent body; `None` for the fixed base.
    pub parent: Option<usize>,
    /// Inertia of all links of the body, in the body frame.
    pub inertia: Inertia,
    /// Collision geometry of all links of the body, in the body frame.
    pub shapes: Vec<Shape>,
}

/// Root of the tree: the root link merged with all links fixed to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// `true` for a floating base, which has six entries of `v` and seven of `q`, before the joints.
    pub floating: bool,
    /// World pose in the neutral configuration, if given in the file.
    pub neutral: Isometry3<f64>,
    /// Inertia in the frame of the base's first link. Unused for a fixed base.
    pub inertia: Inertia,
    /// Collision geometry in the same frame.
    pub shapes: Vec<Shape>,
    /// Collision geometry fixed to the world next to a floating base.
    pub world_shapes: Vec<Shape>,
}
