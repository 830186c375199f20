//! The robot: bodies, joints, frames. Immutable once built.

mod frame;
mod inertia;
mod joint;
mod shape;
pub(crate) mod tree;

use nalgebra::DVector;

pub use frame::{Frame, FrameId, UnknownFrame};
pub use inertia::Inertia;
pub use joint::{Coordinate, Joint, JointDynamics, JointKind, Limits};
pub use shape::{Geometry, Shape};

use crate::nearest::nearest;
use tree::Node;

/// The body moved by one joint, with every link fixed to it merged in.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// URDF child link of the joint; its frame is the body frame.
    pub name: String,
    /// Joint that moves it.
    pub joint: Joint,
    /// Parent body; `None` for the fixed base.
    pub parent: Option<usize>,
    /// Inertia of all its links, in the body frame.
    pub inertia: Inertia,
    /// Collision geometry of all its links, in the body frame.
    pub shapes: Vec<Shape>,
}

/// A robot on a fixed base.
#[derive(Clone, Debug)]
pub struct Model {
    name: String,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    base_shapes: Vec<Shape>,
    joint_names: Vec<String>,
    joint_bodies: Vec<usize>,
    lower: DVector<f64>,
    upper: DVector<f64>,
    velocity_limit: DVector<f64>,
    effort_limit: DVector<f64>,
    nodes: Vec<Node>,
}

impl Model {
    /// Bodies must stand parents first and their independent coordinates must count 0, 1, 2 ... in that order.
    pub(crate) fn new(name: String, bodies: Vec<Body>, frames: Vec<Frame>, base_shapes: Vec<Shape>) -> Self {
        let mut joint_bodies = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            debug_assert!(body.parent.is_none_or(|parent| parent < index));
            if let Coordinate::Independent(column) = body.joint.coordinate {
                debug_assert_eq!(column, joint_bodies.len());
                joint_bodies.push(index);
            }
        }
        let limit = |pick: fn(&Limits) -> f64| {
            DVector::from_iterator(
                joint_bodies.len(),
                joint_bodies.iter().map(|&index| pick(&bodies[index].joint.limits)),
            )
        };
        Self {
            joint_names: joint_bodies.iter().map(|&index| bodies[index].joint.name.clone()).collect(),
            lower: limit(|limits| limits.lower),
            upper: limit(|limits| limits.upper),
            velocity_limit: limit(|limits| limits.velocity),
            effort_limit: limit(|limits| limits.effort),
            nodes: bodies.iter().map(Node::new).collect(),
            name,
            bodies,
            frames,
            base_shapes,
            joint_bodies,
        }
    }

    /// Name of the robot in its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Length of `v`, `a` and `tau`: the number of independent joints.
    pub fn nv(&self) -> usize {
        self.joint_names.len()
    }

    /// Length of `q`; equal to [`nv`](Self::nv) on a fixed base.
    pub fn nq(&self) -> usize {
        self.nv()
    }

    /// Names of the independent joints, in the order of `q`.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Index in `q` of an independent joint.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joint_names.iter().position(|joint| joint == name)
    }

    /// The independent joint at `index` of `q`.
    pub fn joint(&self, index: usize) -> &Joint {
        &self.bodies[self.joint_bodies[index]].joint
    }

    /// Moving bodies, parents before children.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The body moved by the independent joint at `index` of `q`.
    pub fn joint_body(&self, index: usize) -> usize {
        self.joint_bodies[index]
    }

    /// Frames of all URDF links, the root first, parents before children.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The frame of the link `name`.
    ///
    /// # Errors
    ///
    /// [`UnknownFrame`], with the nearest name.
    pub fn frame(&self, name: &str) -> Result<FrameId, UnknownFrame> {
        self.frames.iter().position(|frame| frame.name == name).map(FrameId).ok_or_else(|| UnknownFrame {
            name: name.to_owned(),
            robot: self.name.clone(),
            nearest: nearest(name, self.frames.iter().map(|frame| frame.name.as_str())).map(str::to_owned),
        })
    }

    /// Lowest positions \[rad or m\], one per independent joint, -inf where there is no limit.
    pub fn lower(&self) -> &DVector<f64> {
        &self.lower
    }

    /// Highest positions \[rad or m\], one per independent joint, +inf where there is no limit.
    pub fn upper(&self) -> &DVector<f64> {
        &self.upper
    }

    /// Largest speeds \[rad/s or m/s\], one per independent joint, +inf where there is no limit.
    pub fn velocity_limit(&self) -> &DVector<f64> {
        &self.velocity_limit
    }

    /// Largest efforts \[Nm or N\], one per independent joint, +inf where there is no limit.
    pub fn effort_limit(&self) -> &DVector<f64> {
        &self.effort_limit
    }

    /// Collision geometry of the links fixed to the world, in the world frame.
    pub fn base_shapes(&self) -> &[Shape] {
        &self.base_shapes
    }

    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }
}
