//! Denavit-Hartenberg frames of the model, on the joint axes and their common normals (Denavit and Hartenberg
//! 1955, in the modified form of Craig 1986). The transform from a body to its parent consists of a screw
//! about z and a screw about x. It needs a third of the arithmetic of a general transform.
//!
//! A body's frame may rotate about and slide along its joint's axis. This freedom is used for the child with
//! the largest subtree. All other children, and children of a floating base, whose frame is given, keep a
//! general placement.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, Vector3};

use super::node::Node;
use crate::math::{LANES, M3, RigidInertia, Turn, V3};

/// Angle between axes above which the foot of their common normal is accurate.
const SKEW: f64 = 0.05;

/// Rounding of angles and lengths of about one.
const ROUNDING: f64 = 1e-14;

/// Constant part of the transform from a body's axis to its parent's, after the rotation about and
/// translation along its own.
#[derive(Clone, Debug)]
pub(crate) enum LinkTransform {
    /// Along the common normal.
    CommonNormal { turn: Turn, shift: f64 },
    /// General transform.
    General { rotation: M3, translation: V3 },
}

/// A body in the frame on its joint axis.
#[derive(Clone, Debug)]
pub(crate) struct DhBody {
    /// Index of the parent: 0 is the base, body `i` is `i + 1`.
    pub(crate) parent: usize,
    pub(crate) prismatic: bool,
    /// `true` if some child does not immediately follow it.
    pub(crate) forks: bool,
    pub(crate) transform: LinkTransform,
    /// Inertia about the frame's origin.
    pub(crate) inertia: RigidInertia,
}

/// Joint angle and translation at each position: angle = turning * q, rotated further by `sin` and `cos`;
/// translation = sliding * q + lift.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointZeros {
    pub(crate) turning: [f64; LANES],
    pub(crate) sliding: [f64; LANES],
    pub(crate) sin: [f64; LANES],
    pub(crate) cos: [f64; LANES],
    pub(crate) lift: [f64; LANES],
}

/// The bodies in their frames, and the zero positions of their joints side by side.
#[derive(Clone, Debug)]
pub(crate) struct DhFrames {
    pub(crate) bodies: Vec<DhBody>,
    pub(crate) zeros: Vec<JointZeros>,
}

/// Rotation about and translation along z from a node frame to the body's frame here.
#[derive(Clone, Copy)]
struct Along {
    sin: f64,
    cos: f64,
    slide: f64,
}

impl Along {
    const NONE: Self = Self { sin: 0.0, cos: 1.0, slide: 0.0 };

    fn pose(&self) -> IsometryMatrix3<f64> {
        let rotation = Matrix3::new(self.cos, -self.sin, 0.0, self.sin, self.cos, 0.0, 0.0, 0.0, 1.0);
        isometry(&rotation, &Vector3::new(0.0, 0.0, self.slide))
    }
}

impl DhFrames {
    /// Computes the frames of bodies ordered parents first.
    pub(crate) fn new(nodes: &[Node]) -> Self {
        let mut along = vec![Along::NONE; nodes.len()];
        let mut normals: Vec<Option<(Turn, f64, Along)>> = vec![None; nodes.len()];
        for (index, child) in heaviest_children(nodes).into_iter().enumerate() {
            let Some(child) = child else { continue };
            if let Some((own, turn, shift, rest)) = common_normal(&nodes[child]) {
                along[index] = own;
                normals[child] = Some((turn, shift, rest));
            }
        }
        let mut bodies = Vec::with_capacity(nodes.len());
        let blank = JointZeros {
            turning: [0.0; LANES],
            sliding: [0.0; LANES],
            sin: [0.0; LANES],
            cos: [1.0; LANES],
            lift: [0.0; LANES],
        };
        let mut zeros = vec![blank; nodes.len().div_ceil(LANES)];
        for (index, (node, own)) in nodes.iter().zip(&along).enumerate() {
            let (transform, rest) = match &normals[index] {
                Some((turn, shift, rest)) => {
                    (LinkTransform::CommonNormal { turn: *turn, shift: *shift }, *rest)
                }
                None => {
                    let parent = node.parent.checked_sub(1).map_or(Along::NONE, |parent| along[parent]);
                    let way = parent.pose().inverse() * placement(node);
                    let (rotation, translation) = parts(&way);
                    (LinkTransform::General { rotation, translation }, Along::NONE)
                }
            };
            let (back, lift) = parts(&own.pose().inverse());
            let inertia = node.inertia.moved(&back, lift);
            bodies.push(DhBody {
                parent: node.parent,
                prismatic: node.prismatic,
                forks: false,
                transform,
                inertia,
            });
            let (zero, lane) = (&mut zeros[index / LANES], index % LANES);
            zero.turning[lane] = if node.prismatic { 0.0 } else { 1.0 };
            zero.sliding[lane] = if node.prismatic { 1.0 } else { 0.0 };
            zero.sin[lane] = rest.sin * own.cos + rest.cos * own.sin;
            zero.cos[lane] = rest.cos * own.cos - rest.sin * own.sin;
            zero.lift[lane] = rest.slide + own.slide;
        }
        for (index, node) in nodes.iter().enumerate() {
            if let Some(parent) = node.parent.checked_sub(1)
                && node.parent != index
            {
                bodies[parent].forks = true;
            }
        }
        Self { bodies, zeros }
    }
}

/// Returns, for every body, the child with the largest subtree.
fn heaviest_children(nodes: &[Node]) -> Vec<Option<usize>> {
    let mut carried = vec![1_usize; nodes.len()];
    let mut heaviest: Vec<Option<usize>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        if let Some(parent) = node.parent.checked_sub(1) {
            carried[parent] += carried[index];
            if heaviest[parent].is_none_or(|other| carried[other] <= carried[index]) {
                heaviest[parent] = Some(index);
            }
        }
    }
    heaviest
}

/// Returns rotation and translation of the parent's frame along its axis, rotation about and translation
/// along the common normal, and the remaining rotation and translation along the node's axis. `None` if the
/// normal is ill-defined.
fn common_normal(node: &Node) -> Option<(Along, Turn, f64, Along)> {
    let way = placement(node);
    let rotation = way.rotation.into_inner();
    let axis = rotation.column(2).into_owned();
    let offset = way.translation.vector;
    let across = Vector3::new(-axis.y, axis.x, 0.0);
    let sine = across.norm();
    let (normal, slide) = if sine >= SKEW {
        // The foot on the parent's axis: offset + t axis - s z is along the normal; both dotted with z and
        // the axis.
        let (with_z, with_axis) = (offset.z, offset.dot(&axis));
        (across / sine, (with_z - axis.z * with_axis) / (sine * sine))
    } else if sine <= ROUNDING {
        let across = Vector3::new(offset.x, offset.y, 0.0);
        (across.try_normalize(ROUNDING).unwrap_or_else(Vector3::x), offset.z)
    } else {
        return None;
    };
    let own = Along { sin: normal.y, cos: normal.x, slide };
    let rest = own.pose().inverse() * way;
    let (rotation, offset) = (rest.rotation.into_inner(), rest.translation.vector);
    // The axis in the frame that has x along the normal: (0, -sin, cos) of the angle between the axes.
    let (sin, cos) = (-rotation[(1, 2)], rotation[(2, 2)]);
    let length = sin.hypot(cos);
    let (sin, cos) = (sin / length, cos / length);
    let bend = isometry(
        &Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, -sin, 0.0, sin, cos),
        &Vector3::new(offset.x, 0.0, 0.0),
    );
    let left = bend.inverse() * rest;
    let (rotation, left_offset) = (left.rotation.into_inner(), left.translation.vector);
    let length = rotation[(0, 0)].hypot(rotation[(1, 0)]);
    let last = Along { sin: rotation[(1, 0)] / length, cos: rotation[(0, 0)] / length, slide: left_offset.z };
    // the product must equal the original transform
    let found = own.pose() * bend * last.pose();
    let error = (found.to_homogeneous() - way.to_homogeneous()).amax();
    (error <= ROUNDING * (1.0 + way.translation.vector.amax()))
        .then(|| (own, Turn::new(sin, cos), offset.x, last))
}

/// Returns the node frame in the parent's, with the joint at zero.
fn placement(node: &Node) -> IsometryMatrix3<f64> {
    isometry(&node.rotation.into(), &node.translation.into())
}

fn isometry(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(Translation3::from(*translation), Rotation3::from_matrix_unchecked(*rotation))
}

fn parts(pose: &IsometryMatrix3<f64>) -> (M3, V3) {
    (pose.rotation.into_inner().into(), pose.translation.vector.into())
}
