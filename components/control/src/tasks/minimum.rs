//! Minimises a quantity: the task kind that selects one of several costs.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::context::TaskContext;
use super::held::{Driven, HeldTask, TaskCost};
use super::kind::{ActsOn, BuiltTask, Formulations, TaskHead, TaskKind, TaskParameter, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::{
    AccelerationMinimum, ForceRegularisation, MinimumEffortTask, MinimumVelocityTask, TorqueMinimum,
};
use crate::RobotState;

task_config! {
    /// A minimum task: minimises velocities, accelerations, efforts, torques or contact forces.
    MinimumConfig "minimum" {
        /// Quantity to minimise. Default "acceleration".
        of: MinimumOf = MinimumOf::Acceleration;
        /// Cost of the quantity, in the inverse of its unit, 0 to 1000. Default 1e-2.
        weight: f64 = 1e-2 => live(WEIGHTS, "", "cost of the quantity, in the inverse of its unit");
        /// For efforts only: commanded joint speed per gradient of the effort measure, (rad/s)^2, 0 to 1000.
        /// Default 1.
        gain: f64 = 1.0 => live(WEIGHTS, "(rad/s)^2", "speed per slope of the efforts");
        /// For velocities and efforts with `inverse_dynamics`: decay rate of joint velocity errors, 1/s, 0 to
        /// 1000; limited to half the tick rate. Default 20.
        rate: Option<f64> = None;
    }
}

/// Quantity to minimise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MinimumOf {
    /// Velocities. With `inverse_dynamics` the joints are damped.
    Velocity,
    /// Accelerations. Without `inverse_dynamics`, the task minimises the change of the velocities from step
    /// to step.
    Acceleration,
    /// Efforts that support the robot's weight, relative to their limits. Only for robots with a fixed base.
    Effort,
    /// Torques of the drives, as fractions of their limits. Requires `inverse_dynamics`.
    Torque,
    /// Contact forces. Requires `inverse_dynamics`.
    Force,
}

impl TaskKind for MinimumConfig {
    fn head(&self) -> TaskHead<'_> {
        let head = self.table_head();
        match self.of {
            MinimumOf::Torque | MinimumOf::Force => head.only(Formulations::Torque).acts_on(ActsOn::Forces),
            MinimumOf::Velocity | MinimumOf::Effort => head.acts_on(ActsOn::Joints),
            MinimumOf::Acceleration => head,
        }
    }

    /// Parameters: the weight, and the gain of efforts.
    fn parameters(&self) -> Vec<TaskParameter> {
        self.live().into_iter().take(if self.of == MinimumOf::Effort { 2 } else { 1 }).collect()
    }

    fn check(&self, context: &TaskContext<'_>) -> Result<(), ConfigError> {
        match self.of {
            MinimumOf::Velocity | MinimumOf::Effort => context.rate(self.rate).map(drop)?,
            _ if self.rate.is_some() => {
                let message = "this key has no effect on a quantity other than `velocity` and `effort`";
                return Err(ConfigError::key(context.key("rate"), message).advise("leave it out"));
            }
            _ => {}
        }
        if self.of == MinimumOf::Effort && context.model.base().floating {
            let message = "`effort` requires a fixed base: with a floating base, the drive loads depend on the contact forces";
            return Err(ConfigError::key(context.key("of"), message)
                .advise("of = \"torque\" minimises the torques of the drives, also with a floating base"));
        }
        Ok(())
    }

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let model = context.model;
        Ok(match self.of {
            MinimumOf::Velocity => {
                let task = MinimumVelocityTask::new(model).rate(context.rate(self.rate)?);
                Box::new(Driven::motion(task, self.open(setup)?, |task, [weight], _| task.set_weight(weight)))
            }
            MinimumOf::Effort => {
                let task = MinimumEffortTask::new(model, context.gravity).rate(context.rate(self.rate)?);
                let parameters = self.open(setup)?;
                Box::new(Driven::motion(task, parameters, |task, [weight, gain], _| task.set(gain, weight)))
            }
            MinimumOf::Acceleration if context.torque => {
                let task = AccelerationMinimum::new(model);
                Box::new(Driven::forces(task, self.open(setup)?, |task, [weight], _| task.set_weight(weight)))
            }
            MinimumOf::Acceleration => {
                let [weight] = self.open(setup)?;
                Box::new(Smooth { task: MinimumVelocityTask::new(model), weight })
            }
            MinimumOf::Torque => {
                let task = TorqueMinimum::for_contacts(model, context.contacts);
                Box::new(Driven::forces(task, self.open(setup)?, |task, [weight], _| task.set_weight(weight)))
            }
            MinimumOf::Force => {
                let task = ForceRegularisation::for_contacts(model, context.contacts);
                Box::new(Driven::forces(task, self.open(setup)?, |task, [weight], _| task.set_weight(weight)))
            }
        })
    }
}

/// Minimises the change of velocities from step to step.
struct Smooth {
    task: MinimumVelocityTask,
    weight: Ramped,
}

impl HeldTask for Smooth {
    fn begin(&mut self, _: &RobotState<'_>) {
        self.task.set_rest();
    }

    fn reset(&mut self) {
        self.task.set_rest();
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.task.set_weight(self.weight.follow(bounds, fades));
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Motion(&mut self.task)
    }

    fn solved(&mut self, velocity: &[f64]) {
        self.task.set_target(velocity);
    }
}
