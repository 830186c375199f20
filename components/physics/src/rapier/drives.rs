//! Drives with effort limits, which rapier does not support.

use super::Rapier;
use super::multibody::DriveAction;
use crate::articulated::Singular;
use crate::robot::{Robot, State};
use crate::{StepError, StepReport};

impl Rapier {
    /// Sets every drive for a step with integration steps of `h` \[s\]: either its law or its limit acts. In
    /// the latter case `overdriven` is set, and `tau_next` holds the effort.
    pub(super) fn command_drives(&mut self, robot: &mut Robot, h: f64) -> Result<(), StepError> {
        let Robot { articulations, joints, commands, state, gravity, .. } = robot;
        let own = &articulations[0];
        let model = &own.model;
        let State { q, v, q_next, v_next, tau_next, .. } = state;
        // The motion without contacts predicts which drives saturate.
        let free = self.integrator.advance(model, q_next, v_next, commands, *gravity, h, tau_next);
        free.map_err(|Singular(index)| StepError::singular(own, index))?;
        for (i, joint) in joints.iter().enumerate() {
            let c = commands[i];
            let limit = joint.effort_limit;
            let law = c.kp * (c.position - q[i]) + c.kd * (c.velocity - v[i]) + c.effort;
            let braked = v_next[i] > c.max_velocity || v_next[i] < c.min_velocity;
            if !braked && self.overdriven[i] && law.abs() > limit {
                tau_next[i] = limit.copysign(law);
            }
            self.overdriven[i] = braked || tau_next[i].abs() >= limit;
            let action =
                if self.overdriven[i] { DriveAction::Constant(tau_next[i]) } else { DriveAction::Law(c) };
            self.multibody.drive(model, &mut self.scene, (i, q[i]), action, joint);
        }
        Ok(())
    }

    /// Reads the next state of the robot and the efforts that acted.
    pub(super) fn read_state(&mut self, robot: &mut Robot, report: &mut StepReport) {
        let Robot { articulations, joints, commands, state, .. } = robot;
        let model = &articulations[0].model;
        let State { q_next, v_next, tau_next, .. } = state;
        self.multibody.read(model, &self.scene, q_next, v_next);
        for (i, joint) in joints.iter().enumerate() {
            let c = &commands[i];
            let law = c.kp * (c.position - q_next[i]) + c.kd * (c.velocity - v_next[i]) + c.effort;
            let beyond = law.abs() > joint.effort_limit;
            // A drive that was already at its limit applied the value left in `tau_next` by `command_drives`.
            let constant = self.overdriven[i];
            if !constant {
                tau_next[i] = law;
            }
            self.overdriven[i] = beyond;
            report.saturated += usize::from(constant || beyond);
            report.at_limit += usize::from(q_next[i] <= joint.lower || q_next[i] >= joint.upper);
        }
    }
}
