//! Figures of a run of inverse dynamics.

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::component::tasks::Held;
use crate::inverse_dynamics::{Conflicting, ConstraintName, Contact, InverseDynamics};

/// Sum and maximum of a figure of each step.
#[derive(Clone, Copy, Debug, Default)]
struct Figure {
    sum: f64,
    most: f64,
    count: u64,
}

impl Figure {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.most = self.most.max(value);
        self.count += 1;
    }

    fn json(&self) -> Value {
        let mean = if self.count > 0 { self.sum / self.count as f64 } else { 0.0 };
        json!({ "mean": mean, "max": self.most })
    }
}

/// Figures of the steps so far.
#[derive(Clone, Debug)]
pub(super) struct Diagnostics {
    /// One per task.
    residuals: Vec<Figure>,
    iterations: Figure,
    active: Figure,
    at_torque_limit: u64,
    at_friction_limit: u64,
    at_joint_limit: u64,
    relaxed: u64,
    undecided: u64,
    unsolved: u64,
    pub(super) stale: u64,
    slack_contact: f64,
    slack_joint: f64,
    slack_limit: f64,
    slack_task: f64,
    conflict: Option<Conflicting>,
    /// Centre of mass at the start and at the last step.
    centre: Option<(Vector3<f64>, Vector3<f64>)>,
    farthest: f64,
}

impl Diagnostics {
    pub(super) fn new(tasks: usize) -> Self {
        Self {
            residuals: vec![Figure::default(); tasks],
            iterations: Figure::default(),
            active: Figure::default(),
            at_torque_limit: 0,
            at_friction_limit: 0,
            at_joint_limit: 0,
            relaxed: 0,
            undecided: 0,
            unsolved: 0,
            stale: 0,
            slack_contact: 0.0,
            slack_joint: 0.0,
            slack_limit: 0.0,
            slack_task: 0.0,
            conflict: None,
            centre: None,
            farthest: 0.0,
        }
    }

    pub(super) fn reset(&mut self) {
        self.residuals.fill(Figure::default());
        let residuals = std::mem::take(&mut self.residuals);
        *self = Self { residuals, ..Self::new(0) };
    }

    /// A step with a solution.
    pub(super) fn solved(&mut self, control: &InverseDynamics, tasks: &mut [Held]) {
        let solution = control.solution();
        self.iterations.add(f64::from(solution.iterations));
        self.undecided += u64::from(solution.undecided);
        self.active.add(solution.active as f64);
        for (figure, held) in self.residuals.iter_mut().zip(tasks) {
            if let Some(task) = held.counting(control) {
                figure.add(control.residual(task));
            }
        }
        if let Some(slack) = &solution.slack {
            self.relaxed += 1;
            self.slack_contact = self.slack_contact.max(slack.contact);
            self.slack_joint = self.slack_joint.max(slack.joint);
            self.slack_limit = self.slack_limit.max(slack.limit);
            self.slack_task = self.slack_task.max(slack.task);
            self.conflict.get_or_insert(slack.conflict);
            return;
        }
        let (mut torque, mut friction, mut joint) = (false, false, false);
        control.visit_active(&mut |name| match name {
            ConstraintName::Torque { .. } => torque = true,
            ConstraintName::Friction { .. } | ConstraintName::Wrench { .. } => friction = true,
            ConstraintName::Acceleration { .. } => joint = true,
            _ => {}
        });
        self.at_torque_limit += u64::from(torque);
        self.at_friction_limit += u64::from(friction);
        self.at_joint_limit += u64::from(joint);
    }

    /// A step without a solution.
    pub(super) fn failed(&mut self, conflict: Option<Conflicting>) {
        self.unsolved += 1;
        if let Some(conflict) = conflict {
            self.conflict.get_or_insert(conflict);
        }
    }

    /// Position of the centre of mass.
    pub(super) fn set_centre_of_mass(&mut self, centre: Vector3<f64>) {
        let (start, last) = self.centre.get_or_insert((centre, centre));
        *last = centre;
        self.farthest = self.farthest.max((centre - *start).xy().norm());
    }

    pub(super) fn add_to(
        &self,
        result: &mut Value,
        control: &InverseDynamics,
        tasks: &[Held],
        describe: impl Fn(&Conflicting, &[Contact]) -> String,
    ) {
        for (held, figure) in tasks.iter().zip(&self.residuals) {
            result["tasks"][&held.name]["residual"] = figure.json();
        }
        let contacts: Vec<_> = control.contacts().cloned().collect();
        result["solver"] = json!({
            "iterations": self.iterations.json(),
            "active_constraints": self.active.json(),
            "steps_at_a_torque_limit": self.at_torque_limit,
            "steps_at_the_friction_limit": self.at_friction_limit,
            "steps_at_a_joint_limit": self.at_joint_limit,
            "steps_relaxed": self.relaxed,
            "levels_undecided": self.undecided,
            "largest_slack": {
                "contact": self.slack_contact,
                "joint": self.slack_joint,
                "limit": self.slack_limit,
                "task": self.slack_task,
            },
            "first_conflict": self.conflict.map(|conflict| describe(&conflict, &contacts)),
        });
        if let Some((start, last)) = self.centre {
            let array = |v: Vector3<f64>| [v.x, v.y, v.z];
            result["centre_of_mass"] = json!({
                "start": array(start),
                "end": array(last),
                "largest_horizontal_distance_m": self.farthest,
            });
        }
        result["steps_without_solution"] = self.unsolved.into();
        result["steps_without_fresh_state"] = self.stale.into();
    }
}
