//! The steps of a floating robot.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

use super::Floating;
use super::surroundings::base_pose;
use crate::articulated::Singular;
use crate::contact::Response;
use crate::simulator::BASE_BOUND;
use crate::{
    BuildWarning, Contact, Contacts, JointCommand, ObjectId, ResetError, Simulator, StepError, StepReport,
};

/// Touches are foreseen this far ahead at least \[m\].
const FORESIGHT: f64 = 0.002;

/// Nearer than this to a touch, integration steps are as short as contacts want them \[m\].
const NEAR: f64 = 0.010;

impl Floating {
    /// One integration step of `h` \[s\] of the next state.
    fn integrate(&mut self, h: f64, report: &mut StepReport) -> Result<(), StepError> {
        let state = &mut self.state;
        let joints = self.model.joint_count();
        self.kinematics.update_with_velocity(&self.model, &state.q_next, &state.v_next);
        self.surroundings.place(&self.kinematics, &state.q_next);
        let margin = FORESIGHT + 1.5 * h * self.surroundings.fastest(&self.model, &self.kinematics);
        let touches =
            self.surroundings.meet(&self.model, &self.kinematics, &state.v_next, (&self.gravity, h, margin));
        let (commands, rotor_commands) = self.commands.split_at(joints);
        let (tau, thrusts) = state.tau_next.split_at_mut(joints);
        self.outside.fill(0.0);
        for ((rotor, command), thrust) in self.rotors.iter().zip(rotor_commands).zip(thrusts) {
            *thrust = rotor.thrust(command);
            self.kinematics.jacobian(&self.model, rotor.frame, Reference::Local, &mut self.frame_jacobian);
            for (outside, column) in self.outside.iter_mut().zip(self.frame_jacobian.column_iter()) {
                *outside += *thrust * (column[2] + rotor.torque_per_thrust * column[5]);
            }
        }
        let alone = self.model.base().floating && self.rotors.is_empty() && !self.surroundings.touch_robot();
        let before = alone.then(|| self.dynamics.momentum(&self.model, &state.q_next, &state.v_next));
        let events = self.articulated.advance_among(
            &self.model,
            (&mut state.q_next, &mut state.v_next),
            commands,
            (self.gravity, &self.outside),
            h,
            &mut Response(&mut self.surroundings.impulses),
            tau,
        );
        let events = events.map_err(|Singular(index)| StepError::singular(&self.model, index))?;
        if let Some(before) = before {
            let linear = before.linear + self.gravity * (h * self.model.mass());
            self.keep_momentum(linear, before.angular);
        }
        self.surroundings.impulses.push_objects(&mut self.surroundings.objects.next);
        self.surroundings.objects.move_on(h);
        self.h = h;
        report.saturated = report.saturated.max(events.saturated);
        report.at_limit = events.at_limit;
        report.near_contact |= touches > 0;
        Ok(())
    }

    /// Gives the base what momentum is missing in the next state \[kg m/s, kg m2/s\], about the centre of mass.
    fn keep_momentum(&mut self, linear: Vector3<f64>, angular: Vector3<f64>) {
        let state = &mut self.state;
        self.dynamics.centroidal_map(&self.model, &state.q_next, &mut self.momentum_map);
        let mut missing = Vector6::zeros();
        missing.fixed_rows_mut::<3>(0).copy_from(&linear);
        missing.fixed_rows_mut::<3>(3).copy_from(&angular);
        for (column, v) in self.momentum_map.column_iter().zip(&state.v_next) {
            // Entry by entry: a scaled column of this matrix would be a new one on the heap.
            for (missing, entry) in missing.iter_mut().zip(column.iter()) {
                *missing -= entry * v;
            }
        }
        let base: Matrix6<f64> = self.momentum_map.fixed_view::<6, 6>(0, 0).into_owned();
        if let Some(correction) = base.lu().solve(&missing) {
            for (v, correction) in state.v_next.iter_mut().zip(correction.iter()) {
                *v += correction;
            }
        }
    }

    /// Refuses the end of a step that means nothing any more.
    fn verify(&self) -> Result<(), StepError> {
        let v = &self.state.v_next;
        let offset = v.len() - self.model.joint_count();
        for (i, joint) in self.articulated.joints().iter().enumerate() {
            let (velocity, bound) = (v[offset + i], joint.divergence_bound());
            // Written so that NaN fails.
            if !(velocity.abs() < bound && self.state.tau_next[i].is_finite()) {
                let name = self.names[i].clone();
                return Err(StepError::Diverged { joint: i, name, velocity, bound });
            }
        }
        if offset > 0 {
            let (linear, angular) =
                (Vector3::from_column_slice(&v[..3]).norm(), Vector3::from_column_slice(&v[3..6]).norm());
            if !(linear < BASE_BOUND.0 && angular < BASE_BOUND.1) {
                return Err(StepError::BaseDiverged { linear, angular });
            }
        }
        match self.surroundings.objects.broken() {
            Some(object) => {
                Err(StepError::ObjectDiverged { object: self.world.objects[object].name.clone() })
            }
            None => Ok(()),
        }
    }

    /// Something is so near that contacts decide the length of the integration steps.
    fn is_near(&mut self) -> bool {
        self.options.contacts == Contacts::Always || {
            self.surroundings.place(&self.kinematics, &self.state.q);
            self.surroundings.any_within(NEAR)
        }
    }
}

impl Simulator for Floating {
    fn model(&self) -> &Model {
        &self.model
    }

    fn warnings(&self) -> &[BuildWarning] {
        &self.warnings
    }

    fn configuration(&self) -> &[f64] {
        &self.state.q
    }

    fn velocity(&self) -> &[f64] {
        &self.state.v
    }

    fn joint_names(&self) -> &[String] {
        &self.names
    }

    fn positions(&self) -> &[f64] {
        &self.state.positions
    }

    fn velocities(&self) -> &[f64] {
        &self.state.velocities
    }

    fn efforts(&self) -> &[f64] {
        &self.state.efforts
    }

    fn commands_mut(&mut self) -> &mut [JointCommand] {
        &mut self.commands
    }

    fn step(&mut self, dt: f64) -> Result<StepReport, StepError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(StepError::InvalidStep(dt));
        }
        StepError::of_commands(&self.commands, &self.names)?;
        self.state.begin();
        self.surroundings.objects.begin();
        let steps = if self.is_near() { self.options.contact_iterations } else { self.options.substeps };
        let mut report = StepReport::default();
        for _ in 0..steps {
            self.integrate(dt / steps as f64, &mut report)?;
        }
        self.verify()?;
        self.state.commit(&self.model);
        self.surroundings.objects.commit();
        self.kinematics.update(&self.model, &self.state.q);
        let limits = self.articulated.joints().iter().map(|joint| joint.velocity_limit);
        let speeds = self.model.joints_of_v(&self.state.v).iter();
        report.overspeed = speeds.zip(limits).filter(|(v, limit)| v.abs() > *limit).count();
        Ok(report)
    }

    fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        ResetError::of_state(&self.model, q, v)?;
        self.state.q.copy_from_slice(q);
        self.state.v.copy_from_slice(v);
        self.state.efforts.fill(0.0);
        self.state.show(&self.model);
        self.commands.fill(JointCommand::default());
        self.kinematics.update(&self.model, q);
        self.articulated.forget();
        self.surroundings.restart(&self.world);
        self.surroundings.place(&self.kinematics, q);
        Ok(())
    }

    fn gravity(&self) -> Vector3<f64> {
        self.gravity
    }

    fn set_gravity(&mut self, gravity: Vector3<f64>) {
        self.gravity = gravity;
    }

    fn frame_pose(&self, frame: FrameId) -> Isometry3<f64> {
        self.kinematics.pose(&self.model, frame)
    }

    fn object(&self, name: &str) -> Option<ObjectId> {
        self.world.objects.iter().position(|object| object.name == name).map(ObjectId)
    }

    fn object_pose(&self, object: ObjectId) -> Isometry3<f64> {
        self.surroundings.object_pose(object.0)
    }

    fn set_object_pose(&mut self, object: ObjectId, pose: Isometry3<f64>) {
        self.surroundings.set_object_pose(object.0, pose);
    }

    fn object_velocity(&self, object: ObjectId) -> (Vector3<f64>, Vector3<f64>) {
        self.surroundings.object_velocity(object.0)
    }

    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>)) {
        for (index, touch, first, second) in self.surroundings.touches() {
            let force = self.surroundings.impulses.normal(index) / self.h;
            if touch.distance > 0.0 && force <= 0.0 {
                continue;
            }
            visit(&Contact {
                first: &second.name,
                second: &first.name,
                point: touch.point,
                normal: touch.normal,
                depth: (-touch.distance).max(0.0),
                force,
            });
        }
    }

    fn base_pose(&self) -> Isometry3<f64> {
        if self.model.base().floating { base_pose(&self.state.q) } else { Isometry3::identity() }
    }
}
