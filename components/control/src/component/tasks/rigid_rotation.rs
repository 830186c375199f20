//! The rigid rotation task of `control.qp`.

use motorium::prelude::*;
use motorium::state::TwistTarget;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    ActsOn, Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::RobotState;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{RigidRotationTask, VelocityTask};

/// A rigid rotation task: a steered wheel turns until it rolls in the direction in which its base moves it.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RigidRotationConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "rigid_rotation".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link of the wheel: the origin of its frame is the centre of the wheel.
    pub frame: String,
    /// Link of the base, in whose axes the target is given.
    pub base: String,
    /// Axis of the wheel, in the axes of its frame. Default [0, 1, 0].
    pub axis: [f64; 3],
    /// Normal of the ground, in the axes of the world. Default [0, 0, 1].
    pub normal: [f64; 3],
    /// Name of the input port of the velocity of the base: `linear` x and y and `angular` z, in the axes of
    /// `base`. Without a target, or with a stale one (`target_timeout`), the task is inactive. Default
    /// "base_target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 10.
    pub gain: f64,
    /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 1.
    pub weight: f64,
}

impl Default for RigidRotationConfig {
    fn default() -> Self {
        Self {
            name: "rigid_rotation".to_owned(),
            level: 1,
            frame: String::new(),
            base: String::new(),
            axis: [0.0, 1.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            target: "base_target".to_owned(),
            gain: 10.0,
            weight: 1.0,
        }
    }
}

impl RigidRotationConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<RigidRotationTask, ConfigError> {
        let (wheel, base) =
            (place.named_frame("frame", &self.frame)?, place.named_frame("base", &self.base)?);
        let (axis, normal) = (place.axis("axis", self.axis)?, place.axis("normal", self.normal)?);
        let gain = place.in_range("gain", self.gain, GAINS)?;
        let weight = place.in_range("weight", self.weight, WEIGHTS)?;
        Ok(RigidRotationTask::new(place.model, wheel, base, axis).on(normal).with(gain, weight))
    }
}

impl TaskKind for RigidRotationConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target).acts_on(ActsOn::Joints)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::gain(self.gain),
            TaskParameter::new(
                "weight",
                self.weight,
                WEIGHTS,
                "1/(rad/s)",
                "cost of an angular velocity error",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "velocity of the base: linear x and y, angular z, in its own axes";
        declare.optional_input::<TwistTarget>(&self.target, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, input, parameters) = (self.build(place)?, setup.input(&self.target)?, self.open(setup)?);
        Ok(Box::new(RigidRotation { task, input, parameters, error: 0.0 }))
    }
}

/// A wheel that points in the direction of motion of its base.
struct RigidRotation {
    task: RigidRotationTask,
    input: Input<TwistTarget>,
    /// Gain and weight.
    parameters: [Ramped; 2],
    error: f64,
}

impl HeldTask for RigidRotation {
    fn reset(&mut self) {
        self.error = 0.0;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [gain, weight] = self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        self.task.set(gain.min(bounds.max_gain), weight);
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let fresh = self.input.latest().filter(|target| target.age_ns() <= bounds.target_timeout_ns);
        let [x, y, yaw] =
            fresh.map_or([0.0; 3], |target| [target.linear[0], target.linear[1], target.angular[2]]);
        self.task.set_twist(x, y, yaw);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn record(&mut self, _: &RobotState<'_>, _: f64) {
        self.error = self.task.error();
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "last_error_rad": self.error }))
    }
}
