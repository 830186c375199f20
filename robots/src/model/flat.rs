//! The model in flat form for the inner loops: one plain record per body, parents first, without lookups.
//!
//! Every joint rotates about or slides along the z axis of its *node frame*: the body frame, rotated once at
//! construction. With the joint at zero the node frame is the body frame times `align`.

use nalgebra::{Matrix3, Vector3};

use super::dh_frames::DhFrames;
use super::node::Node;
use super::{Base, Body, Frame, Inertia, JointKind};
use crate::math::{LANES, M3, RigidInertia, S3, V3, sin_cos};

/// A frame and the node to which it is fixed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramePlacement {
    /// 0 is the base, body `i` is `i + 1`; [`FlatModel::WORLD`] does not move at all.
    pub(crate) slot: usize,
    pub(crate) rotation: M3,
    pub(crate) position: V3,
}

/// All data that the algorithms read.
#[derive(Clone, Debug)]
pub(crate) struct FlatModel {
    pub(crate) nodes: Vec<Node>,
    /// Node frame in the body frame.
    pub(crate) align: Vec<M3>,
    pub(crate) frame_placements: Vec<FramePlacement>,
    /// Inertia of the floating base about its origin; zero on a fixed base.
    pub(crate) base: RigidInertia,
    pub(crate) floating: bool,
    /// `true` if any joint has an armature.
    pub(crate) geared: bool,
    /// `true` if any joint follows another: columns of `v` then belong to several joints.
    pub(crate) coupled: bool,
    /// `true` if bodies are ordered depth first and each has its own column of `v`.
    pub(crate) orderly: bool,
    /// The bodies in frames on their joint axes.
    pub(crate) dh_frames: DhFrames,
    /// For every column of `v`, the next one towards the base; itself at the root. This is the sparsity of
    /// the mass matrix.
    pub(crate) above: Vec<usize>,
    /// Slots from the base's child to the body itself, for every body: `chains[starts[i]..starts[i + 1]]`.
    chains: Vec<usize>,
    starts: Vec<usize>,
    /// Mass of each body and its subtree \[kg\], the base first.
    pub(crate) carried_masses: Vec<f64>,
    /// End of each body's subtree: with bodies in depth-first order, body `i` carries the bodies up to
    /// `ends[i]`.
    pub(crate) ends: Vec<usize>,
}

impl FlatModel {
    /// Slot of frames fixed in the world next to a floating base.
    pub(crate) const WORLD: usize = usize::MAX;

    pub(crate) fn new(bodies: &[Body], frames: &[Frame], base: &Base, nv: usize) -> Self {
        let floating = base.floating;
        let align: Vec<Matrix3<f64>> = bodies.iter().map(|body| turn_z_to(&body.joint.axis)).collect();
        let (q_start, v_start) = if floating { (7, 6) } else { (0, 0) };
        let mut nodes: Vec<Node> = Vec::with_capacity(bodies.len());
        let (mut chains, mut starts) = (Vec::new(), vec![0]);
        for (body, align) in bodies.iter().zip(&align) {
            let joint = &body.joint;
            let mut rotation = joint.placement.rotation.to_rotation_matrix().into_inner() * align;
            let mut translation = joint.placement.translation.vector;
            if let Some(parent) = body.parent {
                let towards: &Matrix3<f64> = &turn_z_to(&bodies[parent].joint.axis);
                rotation = towards.tr_mul(&rotation);
                translation = towards.tr_mul(&translation);
                let range = starts[parent]..starts[parent + 1];
                chains.extend_from_within(range);
            }
            chains.push(nodes.len() + 1);
            starts.push(chains.len());
            nodes.push(Node {
                rotation: rotation.into(),
                translation: translation.into(),
                inertia: rigid(&body.inertia, align),
                parent: body.parent.map_or(0, |parent| parent + 1),
                prismatic: joint.kind == JointKind::Prismatic,
                column: v_start + joint.coordinate.index(),
                place: q_start + joint.coordinate.index(),
                multiplier: joint.coordinate.multiplier(),
                offset: joint.coordinate.offset(),
                armature: joint.drive.armature() * joint.coordinate.multiplier().powi(2),
            });
        }
        let frame_placements = frames
            .iter()
            .map(|frame| {
                let rotation = frame.placement.rotation.to_rotation_matrix().into_inner();
                let position = frame.placement.translation.vector;
                match frame.body {
                    Some(body) => FramePlacement {
                        slot: body + 1,
                        rotation: align[body].tr_mul(&rotation).into(),
                        position: align[body].tr_mul(&position).into(),
                    },
                    None => FramePlacement {
                        slot: if frame.in_world && floating { Self::WORLD } else { 0 },
                        rotation: rotation.into(),
                        position: position.into(),
                    },
                }
            })
            .collect();
        let coupled = nv - v_start != bodies.len();
        let ends = ends(&nodes);
        Self {
            orderly: ends.is_some() && !coupled,
            carried_masses: carried_masses(&nodes, if floating { base.inertia.mass } else { 0.0 }),
            dh_frames: DhFrames::new(&nodes),
            above: columns_above(&nodes, floating, coupled, nv),
            align: align.into_iter().map(M3::from).collect(),
            frame_placements,
            base: if floating { rigid(&base.inertia, &Matrix3::identity()) } else { RigidInertia::ZERO },
            floating,
            geared: nodes.iter().any(|node| node.armature != 0.0),
            coupled,
            chains,
            starts,
            ends: ends.unwrap_or_default(),
            nodes,
        }
    }

    /// Returns the slots of the bodies that carry body `index`, the body itself last.
    pub(crate) fn chain(&self, index: usize) -> &[usize] {
        &self.chains[self.starts[index]..self.starts[index + 1]]
    }

    /// Returns orientation and position of the base in the world.
    #[inline(always)]
    pub(crate) fn base_pose(&self, q: &[f64]) -> (M3, V3) {
        if self.floating { (quaternion(&q[3..7]), V3::from_slice(&q[..3])) } else { (M3::IDENTITY, V3::ZERO) }
    }
}

/// Joint positions with their sines and cosines.
#[derive(Clone, Debug)]
pub(crate) struct Positions {
    x: Vec<f64>,
    sin: Vec<f64>,
    cos: Vec<f64>,
}

impl Positions {
    pub(crate) fn new(bodies: usize) -> Self {
        let padded = vec![0.0; bodies.next_multiple_of(LANES)];
        Self { x: padded.clone(), sin: padded.clone(), cos: padded }
    }

    #[inline(always)]
    pub(crate) fn update(&mut self, nodes: &[Node], q: &[f64]) {
        for (x, node) in self.x.iter_mut().zip(nodes) {
            *x = node.multiplier * q[node.place] + node.offset;
        }
        sin_cos(&self.x, &mut self.sin, &mut self.cos);
    }

    /// Updates only the joints of `chain`, at their indices in `chain` instead of their node indices.
    #[inline(always)]
    pub(crate) fn update_chain(&mut self, nodes: &[Node], chain: &[usize], q: &[f64]) {
        for (x, &slot) in self.x.iter_mut().zip(chain) {
            let node = &nodes[slot - 1];
            *x = node.multiplier * q[node.place] + node.offset;
        }
        let used = chain.len().next_multiple_of(LANES);
        sin_cos(&self.x[..used], &mut self.sin[..used], &mut self.cos[..used]);
    }

    /// Iterates over position, sine and cosine of every joint.
    #[inline(always)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        self.x.iter().zip(&self.sin).zip(&self.cos).map(|((x, sin), cos)| (*x, *sin, *cos))
    }

    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> (f64, f64, f64) {
        (self.x[index], self.sin[index], self.cos[index])
    }
}

/// Returns the rotation matrix of a quaternion x y z w with any nonzero length.
#[inline(always)]
pub(crate) fn quaternion(q: &[f64]) -> M3 {
    let [x, y, z, w] = [q[0], q[1], q[2], q[3]];
    let s = 2.0 / (x * x + y * y + z * z + w * w);
    let (sx, sy, sz) = (s * x, s * y, s * z);
    let (xx, xy, xz, yy, yz, zz) = (sx * x, sx * y, sx * z, sy * y, sy * z, sz * z);
    let (wx, wy, wz) = (sx * w, sy * w, sz * w);
    M3 {
        x: V3::new(1.0 - (yy + zz), xy + wz, xz - wy),
        y: V3::new(xy - wz, 1.0 - (xx + zz), yz + wx),
        z: V3::new(xz + wy, yz - wx, 1.0 - (xx + yy)),
    }
}

/// Returns a rotation whose z column is the unit vector `axis`: a permutation or half turn if the axis is a
/// coordinate axis, otherwise the basis of Duff et al. (Building an orthonormal basis, revisited, JCGT 6(1),
/// 2017).
///
/// Each entry is accurate to rounding for every axis: no angle is computed, and the divisor is never smaller
/// than one.
fn turn_z_to(axis: &Vector3<f64>) -> Matrix3<f64> {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let columns = if *axis == z {
        [x, y, z]
    } else if *axis == x {
        [y, z, x]
    } else if *axis == y {
        [z, x, y]
    } else if *axis == -z {
        [x, -y, -z]
    } else if *axis == -x {
        [z, y, -x]
    } else if *axis == -y {
        [x, z, -y]
    } else {
        let sign = 1.0_f64.copysign(axis.z);
        let a = -1.0 / (sign + axis.z);
        let b = axis.x * axis.y * a;
        [
            Vector3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
            Vector3::new(b, sign + axis.y * axis.y * a, -axis.y),
            *axis,
        ]
    };
    Matrix3::from_columns(&columns)
}

fn rigid(inertia: &Inertia, align: &Matrix3<f64>) -> RigidInertia {
    let rotational = align.transpose() * inertia.about_origin() * align;
    RigidInertia {
        mass: inertia.mass,
        moment: (align.tr_mul(&inertia.com) * inertia.mass).into(),
        rotational: S3::from_upper(&rotational),
    }
}

/// Returns the mass of the base and of each body, including subtrees.
fn carried_masses(nodes: &[Node], base: f64) -> Vec<f64> {
    let mut masses: Vec<f64> =
        std::iter::once(base).chain(nodes.iter().map(|node| node.inertia.mass)).collect();
    for (index, node) in nodes.iter().enumerate().rev() {
        masses[node.parent] += masses[index + 1];
    }
    masses
}

/// Returns the end of each body's range of bodies; `None` if a body is outside its parent's range.
fn ends(nodes: &[Node]) -> Option<Vec<usize>> {
    let mut ends: Vec<usize> = (1..=nodes.len()).collect();
    for (index, node) in nodes.iter().enumerate().rev() {
        if let Some(parent) = node.parent.checked_sub(1) {
            ends[parent] = ends[parent].max(ends[index]);
        }
    }
    // in depth-first order, every body immediately follows its parent's range so far
    let mut open: Vec<usize> = Vec::new();
    for (index, node) in nodes.iter().enumerate() {
        while open.last().is_some_and(|&last| ends[last] <= index) {
            open.pop();
        }
        if open.last().map_or(0, |last| last + 1) != node.parent {
            return None;
        }
        open.push(index);
    }
    Some(ends)
}

/// Returns the next column to the left that is coupled to a column of the factored mass matrix, or the column
/// itself.
fn columns_above(nodes: &[Node], floating: bool, coupled: bool, nv: usize) -> Vec<usize> {
    if coupled {
        return chains(nodes, floating, nv);
    }
    let mut above: Vec<usize> = (0..nv).map(|column| column.saturating_sub(1)).collect();
    for node in nodes {
        above[node.column] = match node.parent {
            0 if floating => 5,
            0 => node.column,
            parent => nodes[parent - 1].column,
        };
    }
    above
}

/// Coupled joints can fill the matrix, but not between trees connected only by the fixed base. Returns a
/// chain of the columns of each tree.
fn chains(nodes: &[Node], floating: bool, nv: usize) -> Vec<usize> {
    let whole = || (0..nv).map(|column| column.saturating_sub(1)).collect();
    if floating {
        return whole();
    }
    let mut roots: Vec<usize> = Vec::with_capacity(nodes.len());
    let mut trees = vec![None; nv];
    for (index, node) in nodes.iter().enumerate() {
        let root = node.parent.checked_sub(1).map_or(index, |parent| roots[parent]);
        roots.push(root);
        // a joint that follows a joint of another tree couples both trees
        if *trees[node.column].get_or_insert(root) != root {
            return whole();
        }
    }
    let last = |column: usize| (0..column).rev().find(|other| trees[*other] == trees[column]);
    (0..nv).map(|column| last(column).unwrap_or(column)).collect()
}
