//! The step of the articulated engine.

use core::ops::Range;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use motorium_robots::{Momentum, Reference};

use super::implicit::{GUESSES, SECANT_GUESSES};
use super::{Articulated, JointEvents, Part, Singular};
use crate::contact::ContactScene;
use crate::robot::{Articulation, Robot, State};
use crate::{Integrator, JointSetpoint, StepError, StepReport};

impl Articulated {
    /// Computes the next state of the robots and the objects, `dt` \[s\] after the current one.
    pub(super) fn advance_by(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.scene.objects.begin();
        for (part, own) in self.parts.iter_mut().zip(&robot.articulations) {
            if own.placed {
                part.begin_placed(own, &robot.state);
            } else {
                part.actuators.begin(robot, &own.drives());
            }
        }
        let counts = [self.options.substeps, self.options.contact_iterations];
        let calm = self.scene.begin_calm(robot, dt, counts);
        let steps = if calm {
            1
        } else {
            self.place_start(robot);
            let steps = self.scene.begin(dt, &robot.gravity, counts);
            self.scene.look_ahead(robot);
            steps
        };
        self.sums.clear();
        let mut report = StepReport::default();
        for step in 0..steps {
            if !calm {
                self.scene.set_lengths(step, dt, counts);
            }
            for (of, part) in self.parts.iter_mut().enumerate() {
                part.h = self.scene.length(of);
            }
            if step > 0 {
                let state = &robot.state;
                let places = self.parts.iter_mut().zip(&robot.articulations).zip(&mut self.bases);
                for ((part, own), base) in places.filter(|((part, _), _)| part.h > 0.0) {
                    let (q, v) = (&state.q_next[own.q()], &state.v_next[own.v()]);
                    part.kinematics.update_with_velocity(&own.model, q, v);
                    *base = own.base_pose(&state.q_next);
                }
                self.place_next(robot);
                self.scene.detect(self.scene.longest(), 0.0);
            }
            self.integrate(robot, step == 0, dt, &mut report)?;
        }
        for part in &self.parts {
            report.saturated += part.saturated;
            report.at_limit += part.at_limit;
        }
        Ok(report)
    }

    /// Runs one integration step of the next state. Robots and objects have been placed; before the `first`
    /// step the next state equals the current one.
    fn integrate(
        &mut self,
        robot: &mut Robot,
        first: bool,
        dt: f64,
        report: &mut StepReport,
    ) -> Result<(), StepError> {
        let Robot { articulations, commands, state, gravity, .. } = robot;
        let Self { parts, scene, sums, .. } = self;
        let kinematics = |of: usize| {
            if first { parts[of].start(&articulations[of]) } else { &parts[of].kinematics }
        };
        scene.prepare(articulations, kinematics, &state.v_next, gravity);
        for (of, (part, own)) in parts.iter_mut().zip(&*articulations).enumerate() {
            if part.h > 0.0 && own.placed {
                part.hold_velocity(own, state);
            } else if part.h > 0.0 {
                part.begin((own, first), (&commands[own.drives()], state), gravity, (scene, of));
            }
        }
        for guess in 0..GUESSES + SECANT_GUESSES {
            if guess == GUESSES {
                // The relaxation is exact without contacts.
                for (of, part) in parts.iter_mut().enumerate() {
                    part.pending &= scene.is_touched(of);
                }
            }
            for (part, own) in parts.iter_mut().zip(&*articulations).filter(|(part, _)| part.pending) {
                let now = (&state.q_next[own.q()], &state.v_next[own.v()]);
                let found = part.integrator.find_free(&own.model, now, part.h);
                found.map_err(|Singular(index)| StepError::singular(own, index))?;
            }
            scene.impulses.solve(parts);
            let mut settled = true;
            for (of, (part, own)) in parts.iter_mut().zip(&*articulations).enumerate() {
                if part.pending {
                    let now = (&state.q_next[own.q()], &state.v_next[own.v()]);
                    part.settled = part.integrator.confirm(&own.model, now, part.h, guess >= GUESSES);
                    part.pending = !part.settled;
                    settled &= part.settled;
                    if part.pending {
                        scene.impulses.solve_again(of);
                    }
                }
            }
            if settled {
                break;
            }
            let driven =
                parts.iter_mut().zip(&*articulations).enumerate().filter(|(_, (_, own))| !own.placed);
            for (of, (part, _)) in driven {
                part.pending |= scene.impulses.is_pending(of);
            }
        }
        for (part, own) in parts.iter_mut().zip(&*articulations).filter(|(part, _)| part.h > 0.0) {
            let events = if own.placed {
                part.finish_placed(own, state)
            } else {
                part.finish((own, first), state, gravity)
            };
            part.saturated = if first { events.saturated } else { part.saturated.max(events.saturated) };
            part.at_limit = events.at_limit;
        }
        scene.add_impulses(first, dt, sums);
        scene.finish();
        report.near_contact |= self.scene.on_robot();
        Ok(())
    }
}

impl Part {
    /// Begins an integration step of the articulation with this index in `scene`.
    fn begin(
        &mut self,
        (own, first): (&Articulation, bool),
        (commands, state): (&[JointSetpoint], &mut State),
        gravity: &Vector3<f64>,
        (scene, of): (&ContactScene, usize),
    ) {
        let h = self.h;
        let (model, rotors) = (&own.model, &own.rotors);
        let kinematics = if first { &own.kinematics } else { &self.kinematics };
        let (commands, rotor_commands) = commands.split_at(model.joint_count());
        self.rotor_force.copy_from_slice(&self.external);
        let thrusts = &mut state.tau_next[own.drives()][model.joint_count()..];
        for ((rotor, command), thrust) in rotors.iter().zip(rotor_commands).zip(thrusts) {
            *thrust = rotor.thrust(command);
            kinematics.jacobian(model, rotor.frame, Reference::Local, &mut self.frame_jacobian);
            for (force, column) in self.rotor_force.iter_mut().zip(self.frame_jacobian.column_iter()) {
                *force += *thrust * (column[2] + rotor.torque_per_thrust * column[5]);
            }
        }
        let (q, v) = (&state.q_next[own.q()], &state.v_next[own.v()]);
        let unpushed = self.external.iter().all(|force| *force == 0.0);
        let elastic = self.actuators.have_drivetrains();
        let commands = self.actuators.pass(
            commands,
            (model.joints_of_q(q), model.joints_of_v(v), h),
            &mut self.integrator,
        );
        let free = self.method == Integrator::Midpoint && unpushed && !elastic && !scene.is_touched(of);
        let method = if free { Integrator::Midpoint } else { Integrator::Euler };
        // A drive must not push against what stops its joint.
        let restrained = !model.base().floating && unpushed && !scene.is_touched(of);
        let forces = (*gravity, self.rotor_force.as_slice());
        self.integrator.begin(model, (q, v), commands, forces, (h, method, restrained));
        let in_the_air = model.base().floating && rotors.is_empty() && unpushed && !scene.is_held(of);
        self.momentum = in_the_air.then(|| match self.integrator.start_momentum(v) {
            Some([linear, angular]) => {
                // The axes of a floating base come from its coordinates.
                let axes = UnitQuaternion::new_unchecked(Quaternion::new(q[6], q[3], q[4], q[5]));
                Momentum { linear: axes * linear, angular: axes * angular }
            }
            None => self.dynamics.momentum(model, q, v),
        });
        (self.pending, self.settled) = (true, false);
    }

    /// Ends an integration step.
    fn finish(
        &mut self,
        (own, first): (&Articulation, bool),
        state: &mut State,
        gravity: &Vector3<f64>,
    ) -> JointEvents {
        let h = self.h;
        let model = &own.model;
        let joints: Range<usize> = own.drives().start..own.drives().start + model.joint_count();
        let State { q_next, v_next, tau_next, restrained, .. } = state;
        let (q, v, tau) = (&mut q_next[own.q()], &mut v_next[own.v()], &mut tau_next[joints.clone()]);
        let events = self.integrator.finish(model, (&mut *q, &mut *v), (h, self.settled), tau);
        for (restrained, now) in restrained[joints].iter_mut().zip(self.integrator.restrained()) {
            *restrained = *now || (*restrained && !first);
        }
        self.actuators.apply(tau, h);
        if let Some(mut momentum) = self.momentum.take() {
            momentum.linear += *gravity * (h * model.mass());
            self.dynamics.set_momentum(model, q, v, &momentum);
        }
        events
    }
}
