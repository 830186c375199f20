//! Manipulability of a frame: Yoshikawa's measure (IJRR 1985) and its gradient.

use nalgebra::{Matrix6, Vector6};

use super::Kinematics;
use super::jacobian::column;
use crate::math::V3;
use crate::{FrameId, Model};

/// Selection of the motions of a frame, in world axes: linear velocity along x, y, z, then angular velocity
/// about x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskRows(pub [bool; 6]);

impl TaskRows {
    /// Linear velocity of the frame's origin.
    pub const POSITION: Self = Self([true, true, true, false, false, false]);
    /// Angular velocity of the frame.
    pub const ORIENTATION: Self = Self([false, false, false, true, true, true]);
    /// All six motions. Metres and radians have equal weights in the manipulability.
    pub const POSE: Self = Self([true; 6]);
}

impl Kinematics {
    /// Returns the manipulability of `frame`: `sqrt(det(J J'))`, where `J` contains the selected rows of the
    /// frame's Jacobian. The manipulability is zero in a singular configuration, and if the number of joints
    /// that move the frame is less than the number of rows. The columns of a floating base are excluded,
    /// because a floating base can move in every direction.
    pub fn manipulability(&self, model: &Model, frame: FrameId, rows: TaskRows) -> f64 {
        // The square root of rounding noise is only accurate to half the digits.
        self.gram(model, frame, rows).determinant().max(0.0).sqrt()
    }

    /// Computes the gradient of the [`manipulability`](Self::manipulability) with respect to the joint motion
    /// and returns the manipulability. `out . v` is the manipulability's rate of change for a velocity `v`
    /// (nv). In a singular configuration the gradient is undefined and `out` is zero.
    pub fn manipulability_gradient(
        &self,
        model: &Model,
        frame: FrameId,
        rows: TaskRows,
        out: &mut [f64],
    ) -> f64 {
        assert_eq!(out.len(), model.nv(), "length of the gradient");
        out.fill(0.0);
        let gram = self.gram(model, frame, rows);
        let measure = gram.determinant().max(0.0).sqrt();
        let Some(factor) = gram.cholesky() else { return measure };
        let flat = model.flat();
        let Some((chain, point)) = self.movers(model, frame) else { return measure };
        // d sqrt(det A) = sqrt(det A) / 2 tr(A^-1 dA), with A = J J': sqrt(det A) sum of (A^-1 J_j) . dJ_j
        // over the columns.
        for (place, &slot) in chain.iter().enumerate() {
            let node = &flat.nodes[slot - 1];
            let weight = factor.solve(&self.masked_column(model, chain, node.column, point, rows));
            let weight = weight * node.multiplier;
            let (linear, angular) = column(node.prismatic, &self.bodies[slot], point);
            for (other_place, &other) in chain.iter().enumerate() {
                let mover = &flat.nodes[other - 1];
                let (their_linear, their_angular) = column(mover.prismatic, &self.bodies[other], point);
                // joints nearer the base rotate the axis; joints farther out move the point
                let (dl, da) = if other_place <= place {
                    (their_angular.cross(linear), their_angular.cross(angular))
                } else {
                    (angular.cross(their_linear), V3::ZERO)
                };
                let change = Vector6::new(dl.x, dl.y, dl.z, da.x, da.y, da.z);
                out[mover.column] += measure * mover.multiplier * weight.dot(&masked(change, rows));
            }
        }
        measure
    }

    /// `J J'` of the selected rows; ones on the diagonal for the others, which do not affect the determinant.
    fn gram(&self, model: &Model, frame: FrameId, rows: TaskRows) -> Matrix6<f64> {
        let mut gram = Matrix6::zeros();
        for (row, counts) in rows.0.into_iter().enumerate() {
            gram[(row, row)] = if counts { 0.0 } else { 1.0 };
        }
        let flat = model.flat();
        if let Some((chain, point)) = self.movers(model, frame) {
            for (place, &slot) in chain.iter().enumerate() {
                // once per column of v, at its first joint
                let at = flat.nodes[slot - 1].column;
                if chain[..place].iter().any(|&earlier| flat.nodes[earlier - 1].column == at) {
                    continue;
                }
                let entries = self.masked_column(model, chain, at, point, rows);
                gram.ger(1.0, &entries, &entries, 1.0);
            }
        }
        gram
    }

    /// Returns the slots that move `frame`, and the position of its origin.
    fn movers<'m>(&self, model: &'m Model, frame: FrameId) -> Option<(&'m [usize], V3)> {
        let flat = model.flat();
        let slot = flat.frame_placements[frame.index()].slot;
        let body = slot.checked_sub(1).filter(|body| *body < flat.nodes.len())?;
        Some((flat.chain(body), self.placement(model, frame).1))
    }

    /// Returns column `at` of the Jacobian: the sum over all joints that share it.
    fn masked_column(
        &self,
        model: &Model,
        chain: &[usize],
        at: usize,
        point: V3,
        rows: TaskRows,
    ) -> Vector6<f64> {
        let flat = model.flat();
        let mut sum = Vector6::zeros();
        for &slot in chain.iter().filter(|&&slot| flat.nodes[slot - 1].column == at) {
            let node = &flat.nodes[slot - 1];
            let (l, a) = column(node.prismatic, &self.bodies[slot], point);
            sum += Vector6::new(l.x, l.y, l.z, a.x, a.y, a.z) * node.multiplier;
        }
        masked(sum, rows)
    }
}

fn masked(mut entries: Vector6<f64>, rows: TaskRows) -> Vector6<f64> {
    for (entry, counts) in entries.iter_mut().zip(rows.0) {
        if !counts {
            *entry = 0.0;
        }
    }
    entries
}
