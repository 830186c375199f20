//! Articulated body algorithm (Featherstone 2008, table 7.1), in base coordinates.
//!
//! Velocity products and gravity are propagated outward as an acceleration. The inward pass then computes the
//! response of a robot at rest, which avoids products of articulated inertias and bias accelerations.

use nalgebra::Vector3;

use super::base_sweep::joint_motion;
use super::recursion::Articulated;
use super::{Dynamics, SingularMassMatrix, Wrench, external};
use crate::math::{ArticulatedInertia, Spatial, V3};
use crate::model::flat::{FlatModel, FramePlacement};
use crate::{FrameId, Model};

impl Dynamics {
    /// Computes forward dynamics of a robot without mimic joints in O(n).
    pub(super) fn aba(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        wrenches: &[(FrameId, Wrench)],
        a_out: &mut [f64],
    ) -> Result<(), SingularMassMatrix> {
        let n = model.nv();
        assert!(v.len() == n && tau.len() == n && a_out.len() == n, "length of v, tau and a");
        self.set_positions(model, q);
        let flat = model.flat();
        self.start_articulated(flat, q, v, gravity);
        self.release(flat, v);
        for (frame, wrench) in wrenches {
            let placement = &flat.frame_placements[frame.index()];
            if placement.slot != FlatModel::WORLD {
                let body = &mut self.articulated[placement.slot];
                body.wrench -= in_base(placement, wrench, body);
            }
        }
        self.gather(flat, tau)?;
        let base = &mut self.articulated[0];
        base.acceleration = Spatial::ZERO;
        if flat.floating {
            let missing = Spatial::from_slice(tau) - base.wrench;
            base.acceleration = base.inertia.solve(missing).ok_or(SingularMassMatrix { index: 0 })?;
            a_out[..6].copy_from_slice(&base.acceleration.array());
        }
        self.respond(flat, a_out);
        Ok(())
    }

    /// Initialises the motion of the base. Gravity is treated as an upward acceleration.
    #[inline(always)]
    fn start_articulated(&mut self, flat: &FlatModel, q: &[f64], v: &[f64], gravity: Vector3<f64>) {
        let base = &mut self.articulated[0];
        let mut up = -V3::from(gravity);
        base.velocity = Spatial::ZERO;
        base.wrench = Spatial::ZERO;
        base.inertia = ArticulatedInertia::ZERO;
        if flat.floating {
            up = flat.base_pose(q).0.tr_mul(up);
            base.velocity = Spatial::from_slice(v);
            base.inertia.add_rigid(&flat.base);
            base.wrench = flat.base.apply(Spatial::new(up, V3::ZERO))
                + base.velocity.cross_wrench(flat.base.apply(base.velocity));
        }
        base.acceleration = Spatial::new(up, V3::ZERO);
    }

    /// Outward pass: poses, velocities, bias accelerations and the corresponding wrenches.
    #[inline(always)]
    fn release(&mut self, flat: &FlatModel, v: &[f64]) {
        for (index, (node, position)) in flat.nodes.iter().zip(self.positions.iter()).enumerate() {
            let (outer, inner) = self.articulated.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let (rotation, translation) = node.pose(position);
            let (r, p) = match node.parent {
                // The base is the frame of the coordinates.
                0 => (rotation, translation),
                _ => (parent.rotation * rotation, parent.position + parent.rotation * translation),
            };
            let joint = joint_motion(node, r.z, p);
            let own = joint * v[node.column];
            let velocity = parent.velocity + own;
            let acceleration = parent.acceleration + parent.velocity.cross_motion(own);
            let inertia = node.inertia.moved(&r, p);
            body.rotation = r;
            body.position = p;
            body.joint = joint;
            body.velocity = velocity;
            body.acceleration = acceleration;
            body.wrench = inertia.apply(acceleration) + velocity.cross_wrench(inertia.apply(velocity));
            body.inertia = ArticulatedInertia::ZERO;
            body.inertia.add_rigid(&inertia);
        }
    }

    /// Inward pass: articulated inertias and the residual of each joint's effort.
    #[inline(always)]
    fn gather(&mut self, flat: &FlatModel, tau: &[f64]) -> Result<(), SingularMassMatrix> {
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.articulated.split_at_mut(index + 1);
            let (parent, body) = (&mut outer[node.parent], &mut inner[0]);
            let yielding = body.inertia.apply(body.joint);
            let d = body.joint.dot(yielding) + node.armature;
            // Cancellation leaves rounding noise instead of an exact zero.
            if d.is_nan() || d <= 1e-14 * magnitude(body.joint, yielding) {
                return Err(SingularMassMatrix { index: node.column });
            }
            let inverse = 1.0 / d;
            let effort = tau[node.column] - body.joint.dot(body.wrench);
            body.yielding = yielding;
            body.inverse = inverse;
            body.effort = effort;
            parent.wrench += body.wrench + yielding * (effort * inverse);
            parent.inertia.add_yielding(&body.inertia, yielding, inverse);
        }
        Ok(())
    }

    /// Outward pass: accelerations.
    #[inline(always)]
    fn respond(&mut self, flat: &FlatModel, a_out: &mut [f64]) {
        for (index, node) in flat.nodes.iter().enumerate() {
            let (outer, inner) = self.articulated.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let a = (body.effort - body.yielding.dot(parent.acceleration)) * body.inverse;
            body.acceleration = parent.acceleration + body.joint * a;
            a_out[node.column] = a;
        }
    }
}

/// Returns the magnitude of the terms of `a . b`.
#[inline(always)]
fn magnitude(a: Spatial, b: Spatial) -> f64 {
    (a.linear.x * b.linear.x).abs()
        + (a.linear.y * b.linear.y).abs()
        + (a.linear.z * b.linear.z).abs()
        + (a.angular.x * b.angular.x).abs()
        + (a.angular.y * b.angular.y).abs()
        + (a.angular.z * b.angular.z).abs()
}

fn in_base(placement: &FramePlacement, wrench: &Wrench, body: &Articulated) -> Spatial {
    let local = external::at_slot(placement, wrench);
    let force = body.rotation * local.linear;
    Spatial { linear: force, angular: body.rotation * local.angular + body.position.cross(force) }
}
