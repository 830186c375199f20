//! The minimum task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::{OnAccelerations, OnVelocities};
use super::{Formulations, HeldTask, TaskBounds, TaskKind, TaskPlace, WEIGHTS};
use crate::RobotState;
use crate::inverse_dynamics::tasks::{AccelerationMinimum, ForceRegularisation, TorqueMinimum};
use crate::tasks::{MinimumEffortTask, MinimumVelocityTask, Task};

/// A minimum task: velocities, accelerations, efforts, torques or contact forces are small.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MinimumConfig {
    /// Name of the task, with which the names of its parameters begin. Default "minimum".
    pub name: String,
    /// Level of the task, 1 to 8: it decides only what the tasks of smaller numbers leave open. Default 1.
    pub level: u32,
    /// The quantity that is small. Default "acceleration".
    pub of: MinimumOf,
    /// Of efforts alone: speed per slope of their sum, (rad/s)^2, 0 to 1000. Default 1.
    pub gain: f64,
    /// Cost of the quantity, in the inverse of its unit, 0 to 1000. Default 1e-2.
    pub weight: f64,
}

/// A quantity that a minimum task makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MinimumOf {
    /// Velocities; without `inverse_dynamics`.
    Velocity,
    /// Accelerations; without `inverse_dynamics` the change of the velocities from step to step.
    Acceleration,
    /// Efforts that hold the robot's weight, as shares of their limits; without `inverse_dynamics`.
    Effort,
    /// Torques of the drives, as shares of their limits; with `inverse_dynamics`.
    Torque,
    /// Contact forces; with `inverse_dynamics`.
    Force,
}

impl Default for MinimumConfig {
    fn default() -> Self {
        let (name, of) = ("minimum".to_owned(), MinimumOf::Acceleration);
        Self { name, level: 1, of, gain: 1.0, weight: 1e-2 }
    }
}

impl TaskKind for MinimumConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn level(&self) -> u32 {
        self.level
    }

    fn formulations(&self) -> Formulations {
        match self.of {
            MinimumOf::Velocity | MinimumOf::Effort => Formulations::Velocity,
            MinimumOf::Acceleration => Formulations::Both,
            MinimumOf::Torque | MinimumOf::Force => Formulations::Torque,
        }
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        place.in_range("weight", self.weight, WEIGHTS)?;
        place.in_range("gain", self.gain, WEIGHTS)?;
        let name = |parameter: &str| format!("{}_{parameter}", self.name);
        declare.float(
            &name("weight"),
            self.weight,
            WEIGHTS,
            "",
            "cost of the quantity, in the inverse of its unit",
        );
        if self.of == MinimumOf::Effort {
            declare.float(&name("gain"), self.gain, WEIGHTS, "(rad/s)^2", "speed per slope of the efforts");
        }
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let model = place.model;
        let parameter = |name: &str| setup.parameter(&format!("{}_{name}", self.name));
        let weight = parameter("weight")?;
        Ok(match self.of {
            MinimumOf::Velocity => Box::new(OnVelocities {
                task: MinimumVelocityTask::new(model),
                parameters: [weight],
                apply: |task, [weight]| task.set_weight(weight),
            }),
            MinimumOf::Effort => Box::new(OnVelocities {
                task: MinimumEffortTask::new(model, place.gravity),
                parameters: [parameter("gain")?, weight],
                apply: |task, [gain, weight]| task.set(gain, weight),
            }),
            MinimumOf::Acceleration if place.torque => Box::new(OnAccelerations {
                task: AccelerationMinimum::new(model),
                parameters: [weight],
                apply: |task, [weight]| task.set_weight(weight),
            }),
            MinimumOf::Acceleration => Box::new(Smooth { task: MinimumVelocityTask::new(model), weight }),
            MinimumOf::Torque => Box::new(OnAccelerations {
                task: TorqueMinimum::of(model, place.contacts),
                parameters: [weight],
                apply: |task, [weight]| task.set_weight(weight),
            }),
            MinimumOf::Force => Box::new(OnAccelerations {
                task: ForceRegularisation::of(model, place.contacts),
                parameters: [weight],
                apply: |task, [weight]| task.set_weight(weight),
            }),
        })
    }
}

/// Velocities that change little from step to step.
struct Smooth {
    task: MinimumVelocityTask,
    weight: Parameter<f64>,
}

impl HeldTask for Smooth {
    fn begin(&mut self, _: &RobotState<'_>) {
        self.task.set_rest();
    }

    fn reset(&mut self) {
        self.task.set_rest();
    }

    fn prepare(&mut self, _: &TaskBounds) {
        self.task.set_weight(self.weight.get());
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        Some(&mut self.task)
    }

    fn solved(&mut self, velocity: &[f64]) {
        self.task.set_target(velocity);
    }
}
