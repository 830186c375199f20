//! Statistics of a run.

use serde_json::{Value, json};

use super::formulation::{Formulation, SolveStats};
use crate::inverse_dynamics::{Conflicting, ConstraintName, Slack};
use crate::tasks::Held;

/// Sum and maximum of a quantity over the steps.
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

/// Statistics of the steps so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Figures {
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
    /// Largest violations.
    slack: Slack,
    conflict: Option<Conflicting>,
}

impl Figures {
    pub(super) fn new(tasks: usize) -> Self {
        Self { residuals: vec![Figure::default(); tasks], ..Self::default() }
    }

    pub(super) fn reset(&mut self) {
        let mut residuals = std::mem::take(&mut self.residuals);
        residuals.fill(Figure::default());
        *self = Self { residuals, ..Self::default() };
    }

    /// Adds a step with a solution.
    pub(super) fn solved(&mut self, stats: &SolveStats, formulation: &impl Formulation, tasks: &mut [Held]) {
        self.iterations.add(f64::from(stats.iterations));
        self.undecided += u64::from(stats.undecided);
        self.active.add(formulation.active() as f64);
        for (figure, held) in self.residuals.iter_mut().zip(tasks) {
            if let Some(residual) = formulation.residual(held) {
                figure.add(residual);
            }
        }
        if let Some(slack) = &stats.slack {
            self.relaxed += 1;
            self.slack = self.slack.worse(slack);
            self.conflict.get_or_insert(slack.conflict);
            return;
        }
        let (mut torque, mut friction, mut joint) = (false, false, false);
        formulation.visit_active(&mut |name| match name {
            ConstraintName::Torque { .. } => torque = true,
            ConstraintName::Friction { .. } | ConstraintName::Wrench { .. } => friction = true,
            ConstraintName::Acceleration { .. } | ConstraintName::Velocity { .. } => joint = true,
            _ => {}
        });
        self.at_torque_limit += u64::from(torque);
        self.at_friction_limit += u64::from(friction);
        self.at_joint_limit += u64::from(joint);
    }

    /// Adds a step without a solution.
    pub(super) fn failed(&mut self, conflict: Option<Conflicting>) {
        self.unsolved += 1;
        if let Some(conflict) = conflict {
            self.conflict.get_or_insert(conflict);
        }
    }

    /// Adds the statistics to the result of a run.
    pub(super) fn add_to(
        &self,
        result: &mut Value,
        tasks: &[Held],
        describe: impl Fn(&Conflicting) -> String,
    ) {
        for (held, figure) in tasks.iter().zip(&self.residuals) {
            result["tasks"][&held.name]["residual"] = figure.json();
        }
        result["solver"] = json!({
            "iterations": self.iterations.json(),
            "active_constraints": self.active.json(),
            "steps_at_a_torque_limit": self.at_torque_limit,
            "steps_at_the_friction_limit": self.at_friction_limit,
            "steps_at_a_joint_limit": self.at_joint_limit,
            "steps_relaxed": self.relaxed,
            "levels_undecided": self.undecided,
            "largest_slack": {
                "contact": self.slack.contact,
                "joint": self.slack.joint,
                "limit": self.slack.limit,
                "task": self.slack.task,
            },
            "first_conflict": self.conflict.as_ref().map(describe),
        });
        result["steps_without_solution"] = self.unsolved.into();
    }
}
