//! Recursive Newton-Euler (Featherstone 2008, table 5.1).

use nalgebra::Vector3;

use super::Dynamics;
use crate::Model;
use crate::model::tree::BASE;

impl Dynamics {
    /// Inverse dynamics: `tau_out = M(q) a + C(q, v) v + g(q)` \[Nm or N\].
    #[expect(clippy::too_many_arguments, reason = "the textbook signature: model, q, v, a, gravity, tau")]
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
        self.move_bodies(model, q, v, Some(a), gravity);
        self.joint_forces(model, tau_out);
    }

    /// Bias forces: `out = C(q, v) v + g(q)` \[Nm or N\], what [`rnea`](Self::rnea) gives for `a = 0`.
    pub fn bias(&mut self, model: &Model, q: &[f64], v: &[f64], gravity: Vector3<f64>, out: &mut [f64]) {
        self.move_bodies(model, q, v, None, gravity);
        self.joint_forces(model, out);
    }

    /// Gravity torques: `out = g(q)` \[Nm or N\], the efforts that hold the robot still at `q`.
    pub fn gravity(&mut self, model: &Model, q: &[f64], gravity: Vector3<f64>, out: &mut [f64]) {
        self.place(model, q);
        for (index, node) in model.nodes().iter().enumerate() {
            // Standing still under gravity is being accelerated upwards.
            let up =
                if node.parent == BASE { -gravity } else { self.bodies[node.parent].linear_acceleration };
            let body = &mut self.bodies[index];
            let up = body.rotation.tr_mul(&up);
            body.linear_acceleration = up;
            body.force = up * node.mass;
            body.moment = node.moment.cross(&up);
        }
        self.joint_forces(model, out);
    }

    /// Outward pass: velocities, accelerations and the net wrench on each body.
    fn move_bodies(&mut self, model: &Model, q: &[f64], v: &[f64], a: Option<&[f64]>, gravity: Vector3<f64>) {
        assert_eq!(v.len(), model.nv(), "length of v");
        self.place(model, q);
        for (index, node) in model.nodes().iter().enumerate() {
            let (linear, angular, linear_acceleration, angular_acceleration) = if node.parent == BASE {
                (Vector3::zeros(), Vector3::zeros(), -gravity, Vector3::zeros())
            } else {
                let parent = &self.bodies[node.parent];
                (parent.linear, parent.angular, parent.linear_acceleration, parent.angular_acceleration)
            };
            let body = &mut self.bodies[index];
            let (r, p) = (&body.rotation, &body.translation);
            let mut w = r.tr_mul(&angular);
            let mut u = r.tr_mul(&(linear + angular.cross(p)));
            let mut dw = r.tr_mul(&angular_acceleration);
            let mut du = r.tr_mul(&(linear_acceleration + angular_acceleration.cross(p)));
            let rate = node.axis * node.rate(v);
            if node.prismatic {
                u += rate;
                du += w.cross(&rate);
            } else {
                w += rate;
                dw += w.cross(&rate);
                du += u.cross(&rate);
            }
            if let Some(a) = a {
                let acceleration = node.axis * node.rate(a);
                if node.prismatic { du += acceleration } else { dw += acceleration }
            }
            let momentum = u * node.mass + w.cross(&node.moment);
            let spin = node.inertia * w + node.moment.cross(&u);
            body.force = du * node.mass + dw.cross(&node.moment) + w.cross(&momentum);
            body.moment = node.inertia * dw + node.moment.cross(&du) + w.cross(&spin) + u.cross(&momentum);
            (body.linear, body.angular) = (u, w);
            (body.linear_acceleration, body.angular_acceleration) = (du, dw);
        }
    }

    /// Inward pass: sums the wrenches towards the base and projects them on the joint axes.
    fn joint_forces(&mut self, model: &Model, out: &mut [f64]) {
        assert_eq!(out.len(), model.nv(), "length of tau");
        out.fill(0.0);
        for (index, node) in model.nodes().iter().enumerate().rev() {
            let body = &self.bodies[index];
            let along = if node.prismatic { &body.force } else { &body.moment };
            out[node.column] += node.multiplier * node.axis.dot(along);
            if node.parent != BASE {
                let force = body.rotation * body.force;
                let moment = body.rotation * body.moment + body.translation.cross(&force);
                let parent = &mut self.bodies[node.parent];
                parent.force += force;
                parent.moment += moment;
            }
        }
    }
}
