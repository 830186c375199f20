//! Recursive Newton-Euler (Luh, Walker and Paul 1980), in the bodies' frames with classical accelerations.

use nalgebra::Vector3;

use super::recursion::Local;
use super::{Dynamics, Wrench, external};
use crate::math::{M3, Spatial, V3, Work, widest};
use crate::model::flat::FlatModel;
use crate::model::node::Node;
use crate::{FrameId, Model};

impl Local {
    /// Returns the classical acceleration of the origin against gravity, the angular velocity and the angular
    /// acceleration.
    pub(super) fn motion(&self) -> (V3, V3, V3) {
        (self.acceleration, self.angular, self.angular_rate)
    }

    /// Transforms a wrench on this body to the parent's origin and axes.
    pub(super) fn to_parent(&self, wrench: Spatial) -> Spatial {
        let force = self.rotation * wrench.linear;
        Spatial { linear: force, angular: self.rotation * wrench.angular + self.translation.cross(force) }
    }
}

impl Dynamics {
    /// Computes inverse dynamics: `tau_out = M(q) a + C(q, v) v + g(q)` \[Nm or N\]. For a floating base, the
    /// first six entries are the external wrench on the base that the motion would require, at the origin of
    /// the base and in its axes.
    pub fn rnea(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        gravity: Vector3<f64>,
        tau_out: &mut [f64],
    ) {
        assert_eq!(a.len(), model.nv(), "length of a");
        assert_eq!(v.len(), model.nv(), "length of v");
        self.set_positions(model, q);
        let flat = model.flat();
        self.start(flat, q, gravity, Some((v, Some(a))));
        self.outward::<true>(flat, v, a);
        self.inward(flat, tau_out);
        turn_rotors(flat, a, tau_out);
    }

    /// Computes inverse dynamics like [`rnea`](Self::rnea), but with external wrenches: `tau_out = M a + C
    /// v + g - sum J' f`.
    ///
    /// Each wrench acts at the origin of its frame, in the axes of the frame.
    pub fn rnea_external(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        gravity: Vector3<f64>,
        wrenches: &[(FrameId, Wrench)],
        tau_out: &mut [f64],
    ) {
        assert_eq!(a.len(), model.nv(), "length of a");
        assert_eq!(v.len(), model.nv(), "length of v");
        self.set_positions(model, q);
        let flat = model.flat();
        self.start(flat, q, gravity, Some((v, Some(a))));
        self.outward::<true>(flat, v, a);
        for (frame, wrench) in wrenches {
            let placement = &flat.frame_placements[frame.index()];
            if placement.slot != FlatModel::WORLD {
                self.local[placement.slot].wrench -= external::at_slot(placement, wrench);
            }
        }
        self.inward(flat, tau_out);
        turn_rotors(flat, a, tau_out);
    }

    /// Computes the motions of all bodies and stores them in their slots.
    pub(super) fn motions(&mut self, model: &Model, q: &[f64], v: &[f64], a: &[f64], gravity: Vector3<f64>) {
        assert!(v.len() == model.nv() && a.len() == model.nv(), "length of v and a");
        self.set_positions(model, q);
        let flat = model.flat();
        self.start(flat, q, gravity, Some((v, Some(a))));
        self.outward::<true>(flat, v, a);
    }

    /// Computes the wrench that moves the whole robot, without gravity, and stores it in slot 0: about the
    /// base's origin, in its axes.
    pub(super) fn base_wrench(&mut self, model: &Model, q: &[f64], v: &[f64], a: &[f64]) {
        let mut tau = std::mem::take(&mut self.scratch);
        tau.resize(model.nv(), 0.0);
        self.rnea(model, q, v, a, Vector3::zeros(), &mut tau);
        self.scratch = tau;
    }

    /// Computes the bias forces `out = C(q, v) v + g(q)` \[Nm or N\]: [`rnea`](Self::rnea) with `a = 0`.
    pub fn bias(&mut self, model: &Model, q: &[f64], v: &[f64], gravity: Vector3<f64>, out: &mut [f64]) {
        assert_eq!(v.len(), model.nv(), "length of v");
        widest(Bias { dynamics: self, model, motion: (q, v), gravity, out });
    }

    /// Computes the gravity torques `out = g(q)` \[Nm or N\]: the efforts that hold the robot at rest at `q`.
    pub fn gravity(&mut self, model: &Model, q: &[f64], gravity: Vector3<f64>, out: &mut [f64]) {
        widest(Gravity { dynamics: self, model, q, gravity, out });
    }

    /// Initialises the motion of the base and the wrench on it.
    #[inline(always)]
    fn start(
        &mut self,
        flat: &FlatModel,
        q: &[f64],
        gravity: Vector3<f64>,
        motion: Option<(&[f64], Option<&[f64]>)>,
    ) {
        let base = &mut self.local[0];
        // Rest under gravity is equivalent to an upward acceleration.
        let up = -V3::from(gravity);
        if !flat.floating {
            *base = Local { acceleration: up, ..Local::START };
            return;
        }
        let (rotation, _) = flat.base_pose(q);
        let up = rotation.tr_mul(up);
        let (v, a) = motion.unwrap_or((&[0.0; 6], None));
        let v = Spatial::from_slice(v);
        let a = a.map_or(Spatial::ZERO, Spatial::from_slice);
        base.angular = v.angular;
        base.angular_rate = a.angular;
        base.acceleration = a.linear + v.angular.cross(v.linear) + up;
        base.point_acceleration = point_acceleration(v.angular, a.angular);
        base.wrench = net_wrench(&flat.base, base);
    }

    /// Outward pass: velocities, accelerations and the net wrench on each body.
    #[inline(always)]
    fn outward<const ACCELERATED: bool>(&mut self, flat: &FlatModel, v: &[f64], a: &[f64]) {
        for (index, (node, position)) in flat.nodes.iter().zip(self.positions.iter()).enumerate() {
            let (outer, inner) = self.local.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let (rotation, translation) = node.pose(position);
            let mut w = rotation.tr_mul(parent.angular);
            let mut dw = rotation.tr_mul(parent.angular_rate);
            let mut acceleration =
                rotation.tr_mul(parent.acceleration + parent.point_acceleration * translation);
            let rate = node.multiplier * v[node.column];
            let rate_of_rate = if ACCELERATED { node.multiplier * a[node.column] } else { 0.0 };
            if node.prismatic {
                // Coriolis: 2 w x z rate
                acceleration.x += 2.0 * w.y * rate;
                acceleration.y -= 2.0 * w.x * rate;
                acceleration.z += rate_of_rate;
            } else {
                // w x z rate
                dw.x += w.y * rate;
                dw.y -= w.x * rate;
                dw.z += rate_of_rate;
                w.z += rate;
            }
            body.rotation = rotation;
            body.translation = translation;
            body.angular = w;
            body.angular_rate = dw;
            body.acceleration = acceleration;
            body.point_acceleration = point_acceleration(w, dw);
            body.wrench = net_wrench(&node.inertia, body);
        }
    }

    /// Inward pass: sums the wrenches towards the base and projects them on the joint axes.
    #[inline(always)]
    fn inward(&mut self, flat: &FlatModel, out: &mut [f64]) {
        assert_eq!(out.len(), flat.above.len(), "length of tau");
        out.fill(0.0);
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.local.split_at_mut(index + 1);
            let (parent, body) = (&mut outer[node.parent], &inner[0]);
            out[node.column] += node.multiplier * along(node, body.wrench);
            let force = body.rotation * body.wrench.linear;
            parent.wrench.linear += force;
            parent.wrench.angular += body.rotation * body.wrench.angular + body.translation.cross(force);
        }
        if flat.floating {
            out[..6].copy_from_slice(&self.local[0].wrench.array());
        }
    }
}

/// Bias forces at these positions and velocities.
struct Bias<'a> {
    dynamics: &'a mut Dynamics,
    model: &'a Model,
    motion: (&'a [f64], &'a [f64]),
    gravity: Vector3<f64>,
    out: &'a mut [f64],
}

impl Work for Bias<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { dynamics, model, motion: (q, v), gravity, out } = self;
        dynamics.set_positions(model, q);
        let flat = model.flat();
        dynamics.start(flat, q, gravity, Some((v, None)));
        dynamics.outward::<false>(flat, v, &[]);
        dynamics.inward(flat, out);
    }
}

/// Gravity torques at these positions.
struct Gravity<'a> {
    dynamics: &'a mut Dynamics,
    model: &'a Model,
    q: &'a [f64],
    gravity: Vector3<f64>,
    out: &'a mut [f64],
}

impl Work for Gravity<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { dynamics, model, q, gravity, out } = self;
        dynamics.set_positions(model, q);
        let flat = model.flat();
        dynamics.start(flat, q, gravity, None);
        for (index, (node, position)) in flat.nodes.iter().zip(dynamics.positions.iter()).enumerate() {
            let (rotation, translation) = node.pose(position);
            let up = rotation.tr_mul(dynamics.local[node.parent].acceleration);
            let body = &mut dynamics.local[index + 1];
            (body.rotation, body.translation, body.acceleration) = (rotation, translation, up);
            body.wrench = Spatial::new(up * node.inertia.mass, node.inertia.moment.cross(up));
        }
        dynamics.inward(flat, out);
    }
}

/// Adds the efforts that accelerate the rotors of the drives.
#[inline(always)]
fn turn_rotors(flat: &FlatModel, a: &[f64], tau: &mut [f64]) {
    if flat.geared {
        for node in &flat.nodes {
            tau[node.column] += node.armature * a[node.column];
        }
    }
}

/// Returns the component of a wrench carried by the joint's drive.
#[inline(always)]
fn along(node: &Node, wrench: Spatial) -> f64 {
    if node.prismatic { wrench.linear.z } else { wrench.angular.z }
}

/// `[alpha]x + [omega]x^2`
#[inline(always)]
fn point_acceleration(w: V3, dw: V3) -> M3 {
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
    M3 {
        x: V3::new(-(yy + zz), xy + dw.z, xz - dw.y),
        y: V3::new(xy - dw.z, -(xx + zz), yz + dw.x),
        z: V3::new(xz + dw.y, yz - dw.x, -(xx + yy)),
    }
}

/// Returns the wrench about the origin for the motion of a body, by the Newton-Euler equations.
#[inline(always)]
fn net_wrench(inertia: &crate::math::RigidInertia, body: &Local) -> Spatial {
    let spin = inertia.rotational * body.angular;
    Spatial {
        linear: body.acceleration * inertia.mass + body.point_acceleration * inertia.moment,
        angular: inertia.rotational * body.angular_rate
            + body.angular.cross(spin)
            + inertia.moment.cross(body.acceleration),
    }
}
