//! The step of the articulated engine.

use nalgebra::{Matrix6, Vector3, Vector6};

use motorium_robots::Reference;

use super::{Articulated, Singular};
use crate::contact::ContactResponse;
use crate::robot::{Robot, base_pose};
use crate::{StepError, StepReport};

/// Closer than this to a contact, contacts decide the length of the integration steps \[m\].
const NEAR: f64 = 0.010;

impl Articulated {
    /// The robot's and the objects' next state, `dt` \[s\] after the current one.
    pub(super) fn advance_by(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.scene.objects.begin();
        self.actuators.begin(robot);
        self.scene.set_poses(&robot.kinematics, &robot.base_pose());
        let near = self.scene.detect(dt, NEAR).iter().any(|point| point.distance < NEAR);
        let steps = if near { self.options.contact_iterations } else { self.options.substeps };
        self.sums.clear();
        let mut report = StepReport::default();
        let h = dt / steps as f64;
        for step in 0..steps {
            if step > 0 {
                let state = &robot.state;
                self.kinematics.update_with_velocity(&robot.model, &state.q_next, &state.v_next);
                let base =
                    if robot.model.base().floating { base_pose(&state.q_next) } else { robot.base_pose() };
                self.scene.set_poses(&self.kinematics, &base);
                self.scene.detect(h, 0.0);
            }
            self.integrate(robot, step == 0, h, &mut report)?;
        }
        Ok(report)
    }

    /// One integration step of `h` \[s\] of the next state. Robot and objects have been placed; before the `first`
    /// step the next state is the current one.
    fn integrate(
        &mut self,
        robot: &mut Robot,
        first: bool,
        h: f64,
        report: &mut StepReport,
    ) -> Result<(), StepError> {
        let Robot { model, rotors, commands, state, gravity, .. } = robot;
        let kinematics = if first { &robot.kinematics } else { &self.kinematics };
        self.scene.prepare(model, kinematics, &state.v_next, (gravity, h));
        let (commands, rotor_commands) = commands.split_at(model.joint_count());
        let (tau, thrusts) = state.tau_next.split_at_mut(model.joint_count());
        self.rotor_force.copy_from_slice(&self.external);
        for ((rotor, command), thrust) in rotors.iter().zip(rotor_commands).zip(thrusts) {
            *thrust = rotor.thrust(command);
            kinematics.jacobian(model, rotor.frame, Reference::Local, &mut self.frame_jacobian);
            for (force, column) in self.rotor_force.iter_mut().zip(self.frame_jacobian.column_iter()) {
                *force += *thrust * (column[2] + rotor.torque_per_thrust * column[5]);
            }
        }
        let alone = rotors.is_empty() && self.external.iter().all(|force| *force == 0.0);
        let in_the_air = model.base().floating && alone && !self.scene.between_robot_and_world();
        let before = in_the_air.then(|| self.dynamics.momentum(model, &state.q_next, &state.v_next));
        let offset = state.v_next.len() - model.joint_count();
        let joints = (model.joints_of_q(&state.q_next), &state.v_next[offset..], h);
        let commands = self.actuators.pass(commands, joints, &mut self.integrator);
        let events = self.integrator.advance_among(
            model,
            (&mut state.q_next, &mut state.v_next),
            commands,
            (*gravity, &self.rotor_force),
            h,
            &mut ContactResponse(&mut self.scene.impulses),
            tau,
        );
        let events = events.map_err(|Singular(index)| StepError::singular(model, index))?;
        self.actuators.apply(tau, h);
        for (index, contact, ..) in self.scene.points() {
            let (first, second) = contact.colliders;
            self.sums.add([first, second], &contact.point, &self.scene.impulses.vector(index));
        }
        if let Some(before) = before {
            let linear = before.linear + *gravity * (h * model.mass());
            self.keep_momentum(robot, linear, before.angular);
        }
        self.scene.impulses.push_objects(&mut self.scene.objects.next);
        self.scene.objects.move_on(h);
        self.h = h;
        report.saturated = report.saturated.max(events.saturated);
        report.at_limit = events.at_limit;
        report.near_contact |= self.scene.on_robot();
        Ok(())
    }

    /// Corrects the velocity of the base in the next state so that the robot has this momentum \[kg m/s, kg m2/s\],
    /// about the centre of mass.
    fn keep_momentum(&mut self, robot: &mut Robot, linear: Vector3<f64>, angular: Vector3<f64>) {
        let state = &mut robot.state;
        self.dynamics.centroidal_map(&robot.model, &state.q_next, &mut self.momentum_map);
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
}
