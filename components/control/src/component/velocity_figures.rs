//! Figures of a run of inverse kinematics.

use motorium_robots::Model;
use serde_json::{Value, json};

use super::conflicts::ConstraintRows;
use crate::{DifferentialIk, IkConflict};

/// Figures of the steps so far.
pub(super) struct VelocityFigures {
    /// Names of the constraints.
    names: ConstraintRows,
    first_conflict: Option<IkConflict>,
    /// Largest violation of a constraint task, m/s or rad/s.
    slack: f64,
    relaxed: u64,
    hurried: u64,
    undecided: u64,
    /// Iterations and undecided levels of this step, of all its solutions.
    pub(super) step_iterations: u32,
    pub(super) step_undecided: u32,
    unsolved: u64,
    pub(super) stale: u64,
}

impl VelocityFigures {
    pub(super) fn new(names: ConstraintRows) -> Self {
        Self {
            names,
            first_conflict: None,
            slack: 0.0,
            relaxed: 0,
            hurried: 0,
            undecided: 0,
            step_iterations: 0,
            step_undecided: 0,
            unsolved: 0,
            stale: 0,
        }
    }

    pub(super) fn reset(&mut self) {
        (self.first_conflict, self.slack) = (None, 0.0);
        (self.relaxed, self.hurried, self.undecided) = (0, 0, 0);
        (self.unsolved, self.stale) = (0, 0);
    }

    /// Begins a step.
    pub(super) fn begin_step(&mut self) {
        (self.step_iterations, self.step_undecided) = (0, 0);
    }

    /// Records effort and contradictory constraints after each solution.
    pub(super) fn observe(&mut self, ik: &DifferentialIk) {
        self.step_iterations += ik.iterations();
        self.step_undecided += ik.undecided();
        if let Some(conflict) = ik.conflict() {
            self.slack = self.slack.max(conflict.slack);
            self.first_conflict.get_or_insert(*conflict);
        }
    }

    /// Counts a step.
    pub(super) fn count(&mut self, solved: bool, ik: &DifferentialIk) {
        self.undecided += u64::from(self.step_undecided);
        self.unsolved += u64::from(!solved);
        self.relaxed += u64::from(solved && ik.conflict().is_some());
        self.hurried += u64::from(solved && ik.is_hurried());
    }

    /// Their entries in the result of a run.
    pub(super) fn add_to(&self, result: &mut Value, model: &Model) {
        let words = |conflict: &IkConflict| self.names.describe_velocities(conflict, model);
        result["solver"] = json!({
            "steps_relaxed": self.relaxed,
            "steps_beyond_acceleration": self.hurried,
            "levels_undecided": self.undecided,
            "largest_slack": { "task": self.slack },
            "first_conflict": self.first_conflict.as_ref().map(words),
        });
        result["steps_without_solution"] = self.unsolved.into();
        result["steps_without_fresh_state"] = self.stale.into();
    }
}
