//! Running tasks that have parameters and no target.

use motorium::prelude::*;

use super::{HeldTask, TaskBounds};
use crate::{RobotState, inverse_dynamics::tasks::AccelerationTask, tasks::Task};

/// A task on velocities whose parameters `apply` takes over before each step.
pub(super) struct OnVelocities<T, const N: usize> {
    pub(super) task: T,
    pub(super) parameters: [Parameter<f64>; N],
    pub(super) apply: fn(&mut T, [f64; N]),
}

impl<T: Task + Send + 'static, const N: usize> HeldTask for OnVelocities<T, N> {
    fn begin(&mut self, _: &RobotState<'_>) {}

    fn reset(&mut self) {}

    fn prepare(&mut self, _: &TaskBounds) {
        let values = self.parameters.each_ref().map(Parameter::get);
        (self.apply)(&mut self.task, values);
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        Some(&mut self.task)
    }
}

/// The same on accelerations or contact forces.
pub(super) struct OnAccelerations<T, const N: usize> {
    pub(super) task: T,
    pub(super) parameters: [Parameter<f64>; N],
    pub(super) apply: fn(&mut T, [f64; N]),
}

impl<T: AccelerationTask + Send + 'static, const N: usize> HeldTask for OnAccelerations<T, N> {
    fn begin(&mut self, _: &RobotState<'_>) {}

    fn reset(&mut self) {}

    fn prepare(&mut self, _: &TaskBounds) {
        let values = self.parameters.each_ref().map(Parameter::get);
        (self.apply)(&mut self.task, values);
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        None
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
