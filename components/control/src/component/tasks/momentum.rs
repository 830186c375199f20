//! The momentum task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Formulations, GAINS, HeldTask, TaskBounds, TaskKind, TaskPlace, WEIGHTS};
use crate::RobotState;
use crate::inverse_dynamics::tasks::{AccelerationTask, MomentumRate};
use crate::tasks::Task;

/// A momentum task: the momentum of the whole robot about its centre of mass comes to rest.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MomentumConfig {
    /// Name of the task, with which the names of its parameters begin. Default "momentum".
    pub name: String,
    /// Level of the task, 1 to 8: it decides only what the tasks of smaller numbers leave open. Default 1.
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
    fn build(&self, place: &TaskPlace<'_>) -> Result<MomentumRate, ConfigError> {
        let gain = place.in_range("gain", self.gain, GAINS)?;
        let linear = place.in_range("linear_weight", self.linear_weight, WEIGHTS)?;
        let angular = place.in_range("angular_weight", self.angular_weight, WEIGHTS)?;
        Ok(MomentumRate::angular(place.model, gain).weights(linear, angular))
    }
}

impl TaskKind for MomentumConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn level(&self) -> u32 {
        self.level
    }

    fn formulations(&self) -> Formulations {
        Formulations::Torque
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let name = |parameter: &str| format!("{}_{parameter}", self.name);
        declare.float(&name("gain"), self.gain, GAINS, "1/s", "rate at which the momentum decays");
        let doc = "cost of a force, the rate of the linear momentum";
        declare.float(&name("linear_weight"), self.linear_weight, WEIGHTS, "1/N", doc);
        let doc = "cost of a torque, the rate of the angular momentum";
        declare.float(&name("angular_weight"), self.angular_weight, WEIGHTS, "1/Nm", doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let task = self.build(place)?;
        let parameter = |name: &str| setup.parameter(&format!("{}_{name}", self.name));
        Ok(Box::new(HeldMomentum {
            task,
            gain: parameter("gain")?,
            linear_weight: parameter("linear_weight")?,
            angular_weight: parameter("angular_weight")?,
        }))
    }
}

/// A momentum that comes to rest.
struct HeldMomentum {
    task: MomentumRate,
    gain: Parameter<f64>,
    linear_weight: Parameter<f64>,
    angular_weight: Parameter<f64>,
}

impl HeldTask for HeldMomentum {
    fn begin(&mut self, _: &RobotState<'_>) {}

    fn reset(&mut self) {}

    fn prepare(&mut self, bounds: &TaskBounds) {
        let gain = self.gain.get().min(bounds.max_gain);
        self.task.set(gain, self.linear_weight.get(), self.angular_weight.get());
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        None
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
