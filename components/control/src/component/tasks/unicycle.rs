//! The unicycle task of `control.qp`.

use motorium::prelude::*;
use motorium::state::TwistTarget;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Fades, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS};
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{UnicycleSettings, UnicycleTask, VelocityTask};

/// A unicycle task: a frame moves forward and turns as commanded, and never sideways.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UnicycleConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "unicycle".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link whose frame drives along its x and turns about its z.
    pub frame: String,
    /// Name of the input port of the target, of which `linear` x and `angular` z are used, in the axes of the
    /// frame. Without a target, or with a stale one (`target_timeout`), the frame stands still. Default
    /// "unicycle_target".
    pub target: String,
    /// Cost of an error of the forward speed, 1/(m/s), 0 to 1000. Default 1.
    pub forward_weight: f64,
    /// Cost of a motion sideways, 1/(m/s), 0 to 1000. Default 1.
    pub sideways_weight: f64,
    /// Cost of an error of the yaw rate, 1/(rad/s), 0 to 1000. Default 1.
    pub yaw_weight: f64,
    /// With `inverse_dynamics`: decay rate of velocity errors, 1/s, 0 to 1000; limited to half the tick rate.
    /// Default 20.
    pub rate: Option<f64>,
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
            rate: None,
        }
    }
}

impl UnicycleConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<UnicycleTask, ConfigError> {
        let weight = |name, weight| place.in_range(name, weight, WEIGHTS);
        let rate = place.rate(self.rate)?;
        let settings = UnicycleSettings {
            forward_weight: weight("forward_weight", self.forward_weight)?,
            sideways_weight: weight("sideways_weight", self.sideways_weight)?,
            yaw_weight: weight("yaw_weight", self.yaw_weight)?,
            ..UnicycleSettings::default()
        };
        let frame = place.named_frame("frame", &self.frame)?;
        Ok(UnicycleTask::new(place.model, frame).with(settings).rate(rate))
    }
}

impl TaskKind for UnicycleConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::new(
                "forward_weight",
                self.forward_weight,
                WEIGHTS,
                "1/(m/s)",
                "cost of an error of the forward speed",
            ),
            TaskParameter::new(
                "sideways_weight",
                self.sideways_weight,
                WEIGHTS,
                "1/(m/s)",
                "cost of a motion sideways",
            ),
            TaskParameter::new(
                "yaw_weight",
                self.yaw_weight,
                WEIGHTS,
                "1/(rad/s)",
                "cost of an error of the yaw rate",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "forward speed (linear x) and yaw rate (angular z), in the axes of the frame";
        declare.optional_input::<TwistTarget>(&self.target, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, input, weights) = (self.build(place)?, setup.input(&self.target)?, self.open(setup)?);
        Ok(Box::new(Unicycle { task, input, weights }))
    }
}

/// A frame driven by an input.
struct Unicycle {
    task: UnicycleTask,
    input: Input<TwistTarget>,
    /// Of forward, sideways and yaw.
    weights: [Ramped; 3],
}

impl HeldTask for Unicycle {
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [forward_weight, sideways_weight, yaw_weight] =
            self.weights.each_mut().map(|parameter| parameter.follow(bounds, fades));
        let settings = *self.task.settings();
        self.task.set_settings(UnicycleSettings { forward_weight, sideways_weight, yaw_weight, ..settings });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let fresh = self.input.latest().filter(|target| target.age_ns() <= bounds.target_timeout_ns);
        let (forward, yaw_rate) = fresh.map_or((0.0, 0.0), |target| (target.linear[0], target.angular[2]));
        self.task.set_settings(UnicycleSettings { forward, yaw_rate, ..*self.task.settings() });
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
