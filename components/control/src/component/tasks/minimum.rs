//! The minimum task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::{OnAccelerations, OnMotions};
use super::{
    ActsOn, Fades, Formulations, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace,
    WEIGHTS,
};
use crate::RobotState;
use crate::inverse_dynamics::tasks::{AccelerationMinimum, ForceRegularisation, TorqueMinimum};
use crate::tasks::{MinimumEffortTask, MinimumVelocityTask, VelocityTask};

/// A minimum task: velocities, accelerations, efforts, torques or contact forces are small.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MinimumConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "minimum".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// The quantity that is small. Default "acceleration".
    pub of: MinimumOf,
    /// For efforts only: speed per gradient of their sum, (rad/s)^2, 0 to 1000. Default 1.
    pub gain: f64,
    /// Cost of the quantity, in the inverse of its unit, 0 to 1000. Default 1e-2.
    pub weight: f64,
    /// For velocities and efforts with `inverse_dynamics`: decay rate of joint velocity errors, 1/s, 0 to
    /// 1000; limited to half the tick rate. Default 20.
    pub rate: Option<f64>,
}

/// The minimised quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MinimumOf {
    /// Velocities; with `inverse_dynamics` the joints are damped.
    Velocity,
    /// Accelerations; without `inverse_dynamics` the change of the velocities from step to step.
    Acceleration,
    /// Efforts that hold the robot's weight, relative to their limits; for robots with a fixed base.
    Effort,
    /// Torques of the drives, as shares of their limits; with `inverse_dynamics`.
    Torque,
    /// Contact forces; with `inverse_dynamics`.
    Force,
}

impl Default for MinimumConfig {
    fn default() -> Self {
        let (name, of) = ("minimum".to_owned(), MinimumOf::Acceleration);
        Self { name, level: 1, of, gain: 1.0, weight: 1e-2, rate: None }
    }
}

impl TaskKind for MinimumConfig {
    fn head(&self) -> TaskHead<'_> {
        let head = TaskHead::new(&self.name, self.level);
        match self.of {
            MinimumOf::Torque | MinimumOf::Force => head.only(Formulations::Torque).acts_on(ActsOn::Forces),
            MinimumOf::Velocity | MinimumOf::Effort => head.acts_on(ActsOn::Joints),
            MinimumOf::Acceleration => head,
        }
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        let doc = "cost of the quantity, in the inverse of its unit";
        let mut parameters = vec![TaskParameter::new("weight", self.weight, WEIGHTS, "", doc)];
        if self.of == MinimumOf::Effort {
            let doc = "speed per slope of the efforts";
            parameters.push(TaskParameter::new("gain", self.gain, WEIGHTS, "(rad/s)^2", doc));
        }
        parameters
    }

    fn declare(&self, place: &TaskPlace<'_>, _: &mut Declare) -> Result<(), ConfigError> {
        place.in_range("weight", self.weight, WEIGHTS)?;
        place.in_range("gain", self.gain, WEIGHTS)?;
        match self.of {
            MinimumOf::Velocity | MinimumOf::Effort => place.rate(self.rate).map(drop)?,
            _ if self.rate.is_some() => {
                let message =
                    "of a quantity other than `velocity` and `effort`, which alone have a use for it";
                return Err(ConfigError::key(place.key("rate"), message).advise("leave it out"));
            }
            _ => {}
        }
        if self.of == MinimumOf::Effort && place.model.base().floating {
            let message =
                "`effort` of a robot whose base floats: what its drives hold depends on its contact forces";
            return Err(ConfigError::key(place.key("of"), message)
                .advise("of = \"torque\" makes the torques of the drives themselves small"));
        }
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let model = place.model;
        Ok(match self.of {
            MinimumOf::Velocity => Box::new(OnMotions {
                task: MinimumVelocityTask::new(model).rate(place.rate(self.rate)?),
                parameters: self.open(setup)?,
                apply: |task, [weight], _| task.set_weight(weight),
            }),
            MinimumOf::Effort => Box::new(OnMotions {
                task: MinimumEffortTask::new(model, place.gravity).rate(place.rate(self.rate)?),
                parameters: self.open(setup)?,
                apply: |task, [weight, gain], _| task.set(gain, weight),
            }),
            MinimumOf::Acceleration if place.torque => Box::new(OnAccelerations {
                task: AccelerationMinimum::new(model),
                parameters: self.open(setup)?,
                apply: |task, [weight], _| task.set_weight(weight),
            }),
            MinimumOf::Acceleration => {
                let [weight] = self.open(setup)?;
                Box::new(Smooth { task: MinimumVelocityTask::new(model), weight })
            }
            MinimumOf::Torque => Box::new(OnAccelerations {
                task: TorqueMinimum::for_contacts(model, place.contacts),
                parameters: self.open(setup)?,
                apply: |task, [weight], _| task.set_weight(weight),
            }),
            MinimumOf::Force => Box::new(OnAccelerations {
                task: ForceRegularisation::for_contacts(model, place.contacts),
                parameters: self.open(setup)?,
                apply: |task, [weight], _| task.set_weight(weight),
            }),
        })
    }
}

/// Velocities that change little from step to step.
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

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn solved(&mut self, velocity: &[f64]) {
        self.task.set_target(velocity);
    }
}
