//! The unicycle task of `control.qp`.

use motorium::prelude::*;
use motorium::state::TwistTarget;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Formulations, HeldTask, TaskBounds, TaskKind, TaskPlace, WEIGHTS};
use crate::RobotState;
use crate::tasks::{Task, UnicycleSettings, UnicycleTask};

/// A unicycle task: a frame moves forward and turns as it is told, and never sideways.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UnicycleConfig {
    /// Name of the task, with which the names of its parameters begin. Default "unicycle".
    pub name: String,
    /// Level of the task, 1 to 8: it decides only what the tasks of smaller numbers leave open. Default 1.
    pub level: u32,
    /// Link whose frame drives along its x and turns about its z.
    pub frame: String,
    /// Name of the input port of its target, of which `linear` x and `angular` z count, in the axes of the frame. Without a target, or
    /// with one older than `target_timeout`, it stands. Default "unicycle_target".
    pub target: String,
    /// Cost of an error of the forward speed, 1/(m/s), 0 to 1000. Default 1.
    pub forward_weight: f64,
    /// Cost of a motion sideways, 1/(m/s), 0 to 1000. Default 1.
    pub sideways_weight: f64,
    /// Cost of an error of the yaw rate, 1/(rad/s), 0 to 1000. Default 1.
    pub yaw_weight: f64,
}

impl Default for UnicycleConfig {
    fn default() -> Self {
        Self {
            name: "unicycle".to_owned(),
            level: 1,
            frame: String::new(),
            target: "unicycle_target".to_owned(),
            forward_weight: 1.0,
            sideways_weight: 1.0,
            yaw_weight: 1.0,
        }
    }
}

impl UnicycleConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<UnicycleTask, ConfigError> {
        let weight = |name, weight| place.in_range(name, weight, WEIGHTS);
        let settings = UnicycleSettings {
            forward_weight: weight("forward_weight", self.forward_weight)?,
            sideways_weight: weight("sideways_weight", self.sideways_weight)?,
            yaw_weight: weight("yaw_weight", self.yaw_weight)?,
            ..UnicycleSettings::default()
        };
        Ok(UnicycleTask::new(place.model, place.named_frame("frame", &self.frame)?).with(settings))
    }
}

impl TaskKind for UnicycleConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn level(&self) -> u32 {
        self.level
    }

    fn target(&self) -> Option<&str> {
        Some(&self.target)
    }

    fn formulations(&self) -> Formulations {
        Formulations::Velocity
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "forward speed (linear x) and yaw rate (angular z), in the axes of the frame";
        declare.optional_input::<TwistTarget>(&self.target, doc);
        let name = |parameter: &str| format!("{}_{parameter}", self.name);
        let (weight, doc) = (self.forward_weight, "cost of an error of the forward speed");
        declare.float(&name("forward_weight"), weight, WEIGHTS, "1/(m/s)", doc);
        let (weight, doc) = (self.sideways_weight, "cost of a motion sideways");
        declare.float(&name("sideways_weight"), weight, WEIGHTS, "1/(m/s)", doc);
        let (weight, doc) = (self.yaw_weight, "cost of an error of the yaw rate");
        declare.float(&name("yaw_weight"), weight, WEIGHTS, "1/(rad/s)", doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let parameter = |name: &str| setup.parameter(&format!("{}_{name}", self.name));
        let weights = [parameter("forward_weight")?, parameter("sideways_weight")?, parameter("yaw_weight")?];
        Ok(Box::new(Unicycle { task: self.build(place)?, input: setup.input(&self.target)?, weights }))
    }
}

/// A frame that drives as an input says.
struct Unicycle {
    task: UnicycleTask,
    input: Input<TwistTarget>,
    weights: [Parameter<f64>; 3],
}

impl HeldTask for Unicycle {
    fn begin(&mut self, _: &RobotState<'_>) {}

    fn reset(&mut self) {}

    fn prepare(&mut self, bounds: &TaskBounds) {
        let [forward_weight, sideways_weight, yaw_weight] = self.weights.each_ref().map(Parameter::get);
        let fresh = self.input.latest().filter(|target| target.age_ns() <= bounds.target_timeout_ns);
        let (forward, yaw_rate) = fresh.map_or((0.0, 0.0), |target| (target.linear[0], target.angular[2]));
        let settings = UnicycleSettings { forward, yaw_rate, forward_weight, sideways_weight, yaw_weight };
        self.task.set_settings(settings);
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        Some(&mut self.task)
    }
}
