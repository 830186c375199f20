//! Running tasks: their common interface, and tasks that only have parameters.

use super::{Fades, Ramped, TaskBounds};
use crate::inverse_dynamics::InverseDynamics;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::limits::RowLimit;
use crate::tasks::{Task, VelocityTask};
use crate::{GoalRecord, RobotState};

/// A task with its name and the place of its level.
pub(in crate::component) struct Held {
    pub(in crate::component) name: String,
    /// 0 for the highest.
    pub(in crate::component) level: usize,
    pub(in crate::component) task: Box<dyn HeldTask>,
}

impl Held {
    /// Returns the cost on accelerations or forces; `None` if the task has none, or is inactive while its
    /// contact carries a load.
    pub(in crate::component) fn counting(
        &mut self,
        control: &InverseDynamics,
    ) -> Option<&mut dyn AccelerationTask> {
        let rests = self.task.while_lifted().is_some_and(|contact| control.is_active(contact));
        if rests { None } else { self.task.acceleration() }
    }
}

/// A task of a running controller, with its input and its parameters.
pub(in crate::component) trait HeldTask {
    /// Starts at the measured state `start`, which a task without a target uses as its target.
    fn begin(&mut self, _start: &RobotState<'_>) {}

    /// Clears all targets for a new episode; [`begin`](Self::begin) follows.
    fn reset(&mut self) {}

    /// Applies the current parameters: once per step, and again for each part of the mixture while weights
    /// fade.
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades);

    /// Applies the newest target, once per step, after the parameters.
    fn prepare(&mut self, _bounds: &TaskBounds) {}

    /// Returns the velocity cost of the task; `None` for a task of inverse dynamics only.
    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        None
    }

    /// The cost of the task on accelerations or contact forces, where the controller computes torques and the
    /// task can.
    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        None
    }

    /// Returns soft limits and the cost of a velocity beyond them.
    fn limits(&mut self) -> Option<(&mut [Box<dyn RowLimit>], f64)> {
        None
    }

    /// Returns the contact that must be lifted for the task to be active.
    fn while_lifted(&self) -> Option<usize> {
        None
    }

    /// Returns `true` if the task holds exactly, above all levels.
    fn is_constraint(&self) -> bool {
        false
    }

    /// Receives the velocity of the solution.
    fn solved(&mut self, _velocity: &[f64]) {}

    /// The number of rows of its cost.
    fn rows(&mut self) -> usize {
        if let Some(task) = self.acceleration() {
            return task.rows();
        }
        self.task().map_or(0, |task| task.rows())
    }

    /// Records the error of the measured robot after a step of `dt` seconds.
    fn record(&mut self, _measured: &RobotState<'_>, _dt: f64) {}

    /// The goals of the target, if it has any.
    fn goals(&self) -> Option<&GoalRecord> {
        None
    }

    /// The entry of the task under `tasks` in the result of the run.
    fn result(&self) -> Option<serde_json::Value> {
        None
    }
}

/// A task in both formulations; `apply` sets its parameters before each step.
pub(super) struct OnMotions<T, const N: usize> {
    pub(super) task: T,
    pub(super) parameters: [Ramped; N],
    pub(super) apply: fn(&mut T, [f64; N], &TaskBounds),
}

impl<T: Task + Send + 'static, const N: usize> HeldTask for OnMotions<T, N> {
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let values = self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        (self.apply)(&mut self.task, values, bounds);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}

/// The same on accelerations or contact forces.
pub(super) struct OnAccelerations<T, const N: usize> {
    pub(super) task: T,
    pub(super) parameters: [Ramped; N],
    pub(super) apply: fn(&mut T, [f64; N], &TaskBounds),
}

impl<T: AccelerationTask + Send + 'static, const N: usize> HeldTask for OnAccelerations<T, N> {
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let values = self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        (self.apply)(&mut self.task, values, bounds);
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
