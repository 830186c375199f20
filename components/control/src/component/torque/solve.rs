//! Accelerations and torques of one step.

use super::TorqueController;
use crate::component::dynamics_config::InfeasiblePolicy;
use crate::component::tasks::TaskBounds;
use crate::inverse_dynamics::InverseDynamicsError;

/// Time constant with which the integrated accelerations return to the measured motion, s.
const LEAK: f64 = 0.2;

impl TorqueController {
    /// Computes torques and moves the reference by one tick. False without a solution.
    pub(super) fn solve(&mut self, bounds: &TaskBounds) -> bool {
        let dt = bounds.dt;
        if let Err(error) = self.solve_parts(bounds) {
            let conflict = match error {
                InverseDynamicsError::Infeasible(conflict) => Some(conflict),
                _ => None,
            };
            self.diagnostics.failed(conflict);
            self.conflict = conflict;
            // the drives move on their own, so the next reference starts from there
            if !std::mem::replace(&mut self.failing, true) || self.policy == InfeasiblePolicy::SafeStop {
                self.reference.reset(self.measured.joints().0);
            }
            self.reference_velocity.fill(0.0);
            self.control.write_holding_torque(&self.measured.motion(), &mut self.torque);
            return false;
        }
        (self.failing, self.conflict) = (false, None);
        self.torque.copy_from_slice(self.control.solution().torque.as_slice());
        self.began_for += dt;
        self.diagnostics.solved(&self.control, &mut self.tasks);
        if self.began_for <= self.stiff_start {
            self.reference_velocity.copy_from_slice(self.measured.joints().1);
            return true;
        }
        let solution = self.control.solution();
        let model = &self.measured.model;
        let ((positions, measured), leak) = (self.measured.joints(), dt / LEAK.max(dt));
        let accelerations = model.joints_of_v(solution.acceleration.as_slice());
        let limits = model.velocity_limit();
        let references = self.reference_velocity.iter_mut().zip(limits);
        for (((reference, limit), measured), a) in references.zip(measured).zip(accelerations) {
            *reference = (*reference + a * dt + leak * (measured - *reference)).clamp(-limit, *limit);
        }
        self.reference.integrate(&self.reference_velocity, dt);
        self.reference.limit_tracking_error(positions, self.max_lead);
        true
    }

    /// Decides accelerations and forces: by one solution, or while tasks fade by a mixture of some.
    fn solve_parts(&mut self, bounds: &TaskBounds) -> Result<(), InverseDynamicsError> {
        let parts = self.fades.parts();
        self.output.begin_step();
        if parts == 1 {
            return self.solve_tasks(bounds.dt);
        }
        self.control.drop_mixture();
        for part in 0..parts {
            let share = self.fades.part(part);
            for held in &mut self.tasks {
                held.task.weigh(bounds, &mut self.fades);
            }
            self.solve_tasks(bounds.dt)?;
            self.control.mix(share);
        }
        self.control.take_mixture();
        Ok(())
    }

    /// Solves the task stack with the current weights.
    fn solve_tasks(&mut self, dt: f64) -> Result<(), InverseDynamicsError> {
        let state = self.measured.motion();
        self.control.begin(&state, dt);
        for held in &mut self.tasks {
            let (level, constraint) = (held.level, held.task.is_constraint());
            let rows = if constraint { held.task.rows() } else { 0 };
            match held.counting(&self.control) {
                Some(task) if constraint => self.control.constrain(&state, task),
                Some(task) => self.control.add_task(&state, level, task),
                None => self.control.skip_constraint(rows),
            }
        }
        for limit in &mut self.limits.rows {
            self.control.add_row_limit(&state, limit.as_mut(), dt);
        }
        if let Some(support) = &mut self.limits.support {
            if support.follows {
                support.follow(|visit| self.control.visit_support(&state, visit));
            }
            self.control.add_row_limit(&state, &mut support.limit, dt);
        }
        self.limits.observe();
        self.output.begin_solve();
        let solved = self.control.solve().map(|_| ());
        self.output.end_solve();
        solved
    }
}
