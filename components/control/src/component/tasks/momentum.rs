//! The momentum task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::OnAccelerations;
use super::{Formulations, GAINS, HeldTask, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS};
use crate::tasks::MomentumTask;

/// A momentum task: the momentum of the whole robot about its centre of mass comes to rest.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MomentumConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "momentum".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Rate at which the momentum decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 5.
    pub gain: f64,
    /// Cost of a force, the rate of the linear momentum, 1/N, 0 to 1000. Default 0.
    pub linear_weight: f64,
    /// Cost of a torque, the rate of the angular momentum, 1/Nm, 0 to 1000. Default 0.1.
    pub angular_weight: f64,
}

impl Default for MomentumConfig {
    fn default() -> Self {
        Self { name: "momentum".to_owned(), level: 1, gain: 5.0, linear_weight: 0.0, angular_weight: 0.1 }
    }
}

impl MomentumConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<MomentumTask, ConfigError> {
        let gain = place.in_range("gain", self.gain, GAINS)?;
        let linear = place.in_range("linear_weight", self.linear_weight, WEIGHTS)?;
        let angular = place.in_range("angular_weight", self.angular_weight, WEIGHTS)?;
        Ok(MomentumTask::angular(place.model).rate(gain).weights(linear, angular))
    }
}

impl TaskKind for MomentumConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).only(Formulations::Torque)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::new("gain", self.gain, GAINS, "1/s", "rate at which the momentum decays"),
            TaskParameter::new(
                "linear_weight",
                self.linear_weight,
                WEIGHTS,
                "1/N",
                "cost of a force, the rate of the linear momentum",
            ),
            TaskParameter::new(
                "angular_weight",
                self.angular_weight,
                WEIGHTS,
                "1/Nm",
                "cost of a torque, the rate of the angular momentum",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, _: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        Ok(Box::new(OnAccelerations {
            task: self.build(place)?,
            parameters: self.open(setup)?,
            apply: |task, [gain, linear, angular], bounds| {
                task.set(gain.min(bounds.max_gain), linear, angular)
            },
        }))
    }
}
