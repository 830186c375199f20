//! Running tasks: their common interface, and stateless tasks.

use nalgebra::Vector3;

use super::Task;
use super::ramp::{Fades, Ramped, TaskBounds};
use super::target::TargetInput;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};
use crate::limits::RowLimit;
use crate::{GoalError, GoalRecord, RobotState};

/// A task with its name and the index of its level.
pub(crate) struct Held {
    pub(crate) name: String,
    /// 0 for the highest.
    pub(crate) level: usize,
    /// `true` if the task holds exactly, above all levels.
    pub(crate) is_constraint: bool,
    pub(crate) task: Box<dyn HeldTask>,
}

/// Contribution of a task to a problem.
pub(crate) enum TaskCost<'a> {
    /// A motion, for velocities and accelerations.
    Motion(&'a mut dyn Task),
    /// A cost on accelerations and contact forces.
    Forces(&'a mut dyn AccelerationTask),
    /// Soft limits, and the cost of a velocity beyond them.
    Limits(&'a mut [Box<dyn RowLimit>], f64),
}

impl TaskCost<'_> {
    /// The numbers of rows of the cost and of soft limits.
    pub(crate) fn rows(&self) -> (usize, usize) {
        match self {
            Self::Motion(task) => (task.equation().rows(), 0),
            Self::Forces(task) => (task.rows(), 0),
            Self::Limits(limits, _) => (0, limits.iter().map(|limit| limit.rows()).sum()),
        }
    }

    /// Residual for these unknowns; `None` for soft limits.
    pub(crate) fn residual(&self, x: &[f64]) -> Option<f64> {
        match self {
            Self::Motion(task) => Some(task.equation().cost().residual(x)),
            Self::Forces(task) => Some(task.cost().residual(x)),
            Self::Limits(..) => None,
        }
    }
}

impl Held {
    /// Contribution of the task to a problem of `control`; `None` while its contact carries a load.
    pub(crate) fn acting(&mut self, control: &InverseDynamics) -> Option<TaskCost<'_>> {
        let rests = self.task.while_lifted().is_some_and(|contact| control.is_active(contact));
        if rests { None } else { Some(self.task.cost()) }
    }

    /// Soft limits of the task.
    pub(crate) fn limits(&mut self) -> &mut [Box<dyn RowLimit>] {
        match self.task.cost() {
            TaskCost::Limits(limits, _) => limits,
            TaskCost::Motion(_) | TaskCost::Forces(_) => &mut [],
        }
    }
}

/// A task of a running controller, with its inputs and its parameters.
pub(crate) trait HeldTask {
    /// Starts at the measured state `start`, which a task without a target uses as its target.
    fn begin(&mut self, _start: &RobotState<'_>) {}

    /// Clears all targets for a new episode; [`begin`](Self::begin) follows.
    fn reset(&mut self) {}

    /// Applies the current parameters: once per step, and again for each part of the mixture while weights
    /// fade.
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades);

    /// Applies the latest target, once per step, after the parameters.
    fn prepare(&mut self, _bounds: &TaskBounds) {}

    /// Returns the contribution of the task to a problem.
    fn cost(&mut self) -> TaskCost<'_>;

    /// Returns the contact that must be lifted for the task to be active.
    fn while_lifted(&self) -> Option<usize> {
        None
    }

    /// Receives the velocity of the solution.
    fn solved(&mut self, _velocity: &[f64]) {}

    /// Records the error of the measured robot after a step of `dt` seconds.
    fn record(&mut self, _measured: &RobotState<'_>, _dt: f64) {}

    /// Returns the goals of the target, if it has any.
    fn goals(&self) -> Option<&GoalRecord> {
        None
    }

    /// Returns the entry of the task under `tasks` in the result of the run.
    fn result(&self) -> Option<serde_json::Value> {
        None
    }
}

/// Sets the latest target of a task.
type Follow<T> = Box<dyn FnMut(&mut T, &TaskBounds)>;

/// Point target of a task, and its goals.
pub(super) struct Reach<T> {
    pub(super) target: TargetInput,
    /// Makes the initial state the target, until a target is received.
    pub(super) start: fn(&mut T, &RobotState<'_>),
    /// Sets the target, with its velocity.
    pub(super) follow: fn(&mut T, Vector3<f64>, Vector3<f64>),
    /// Returns the error of the measured robot.
    pub(super) error: fn(&T, &RobotState<'_>) -> GoalError,
}

/// A task that applies its parameters before each step, then its target.
pub(super) struct Driven<T, const N: usize> {
    task: T,
    cost: fn(&mut T) -> TaskCost<'_>,
    parameters: [Ramped; N],
    apply: fn(&mut T, [f64; N], &TaskBounds),
    follow: Follow<T>,
    reach: Option<Reach<T>>,
    result: fn(&T) -> Option<serde_json::Value>,
}

impl<T: 'static, const N: usize> Driven<T, N> {
    fn new(
        task: T,
        cost: fn(&mut T) -> TaskCost<'_>,
        parameters: [Ramped; N],
        apply: fn(&mut T, [f64; N], &TaskBounds),
    ) -> Self {
        Self { task, cost, parameters, apply, follow: Box::new(|_, _| ()), reach: None, result: |_| None }
    }

    /// Creates a cost on accelerations or contact forces; `apply` sets its parameters.
    pub(super) fn forces(task: T, parameters: [Ramped; N], apply: fn(&mut T, [f64; N], &TaskBounds)) -> Self
    where
        T: AccelerationTask,
    {
        Self::new(task, |task| TaskCost::Forces(task), parameters, apply)
    }

    /// Creates a motion task; `apply` sets its parameters.
    pub(super) fn motion(task: T, parameters: [Ramped; N], apply: fn(&mut T, [f64; N], &TaskBounds)) -> Self
    where
        T: Task,
    {
        Self::new(task, |task| TaskCost::Motion(task), parameters, apply)
    }

    /// Adds a target, set by `follow`.
    pub(super) fn following(self, follow: impl FnMut(&mut T, &TaskBounds) + 'static) -> Self {
        Self { follow: Box::new(follow), ..self }
    }

    /// Adds a point target.
    pub(super) fn reaching(self, reach: Reach<T>) -> Self {
        Self { reach: Some(reach), ..self }
    }

    /// Adds an entry in the result of the run.
    pub(super) fn with_result(self, result: fn(&T) -> Option<serde_json::Value>) -> Self {
        Self { result, ..self }
    }
}

impl<T, const N: usize> HeldTask for Driven<T, N> {
    fn begin(&mut self, start: &RobotState<'_>) {
        if let Some(reach) = self.reach.as_ref().filter(|reach| !reach.target.is_set()) {
            (reach.start)(&mut self.task, start);
        }
    }

    fn reset(&mut self) {
        if let Some(reach) = &mut self.reach {
            reach.target.reset();
        }
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let values = self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        (self.apply)(&mut self.task, values, bounds);
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        (self.follow)(&mut self.task, bounds);
        if let Some(reach) = &mut self.reach
            && let Some((point, velocity)) = reach.target.point(bounds)
        {
            (reach.follow)(&mut self.task, point, velocity);
        }
    }

    fn cost(&mut self) -> TaskCost<'_> {
        (self.cost)(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, dt: f64) {
        if let Some(reach) = &mut self.reach {
            reach.target.observe((reach.error)(&self.task, measured), dt);
        }
    }

    fn goals(&self) -> Option<&GoalRecord> {
        self.reach.as_ref().map(|reach| reach.target.goals())
    }

    fn result(&self) -> Option<serde_json::Value> {
        (self.result)(&self.task).or_else(|| self.reach.as_ref().map(|reach| reach.target.result()))
    }
}
