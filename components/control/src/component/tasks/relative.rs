//! The relative task of `control.qp`.

use motorium::prelude::*;
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    ActsOn, Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::RobotState;
use crate::component::checks::pose_of;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{RelativeSettings, RelativeTask, VelocityTask};

/// A relative task: a frame reaches a pose in another frame of the same robot.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RelativeConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "relative".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link whose frame moves. Default: the robot's only end effector.
    pub frame: Option<String>,
    /// Link in whose frame the target is given.
    pub other: String,
    /// Name of the input port of the target: the pose of `frame` in `other`; its velocity is ignored. Without
    /// a target the initial pose is kept. Default "relative_target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 10.
    pub gain: f64,
    /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
    pub position_weight: f64,
    /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
    pub orientation_weight: f64,
}

impl Default for RelativeConfig {
    fn default() -> Self {
        let RelativeSettings { gain, position_weight, orientation_weight, .. } = RelativeSettings::default();
        Self {
            name: "relative".to_owned(),
            level: 1,
            frame: None,
            other: String::new(),
            target: "relative_target".to_owned(),
            gain,
            position_weight,
            orientation_weight,
        }
    }
}

impl RelativeConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<RelativeTask, ConfigError> {
        let frame = place.frame("relative", self.frame.as_deref())?;
        let other = place.named_frame("other", &self.other)?;
        if frame == other {
            let message = format!("`{}` relative to itself", self.other);
            return Err(ConfigError::key(place.key("other"), message).advise("name another link"));
        }
        Ok(RelativeTask::new(place.model, other, frame).with(RelativeSettings {
            error: place.pose_error(),
            gain: place.in_range("gain", self.gain, GAINS)?,
            position_weight: place.in_range("position_weight", self.position_weight, WEIGHTS)?,
            orientation_weight: place.in_range("orientation_weight", self.orientation_weight, WEIGHTS)?,
        }))
    }
}

impl TaskKind for RelativeConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target).acts_on(ActsOn::Joints)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::gain(self.gain),
            TaskParameter::new(
                "position_weight",
                self.position_weight,
                WEIGHTS,
                "1/(m/s)",
                "cost of a velocity error",
            ),
            TaskParameter::new(
                "orientation_weight",
                self.orientation_weight,
                WEIGHTS,
                "1/(rad/s)",
                "cost of an angular velocity error",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        declare.optional_input::<PoseTarget>(&self.target, "pose of the frame in the other frame");
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, input, parameters) = (self.build(place)?, setup.input(&self.target)?, self.open(setup)?);
        Ok(Box::new(Relative {
            task,
            input,
            parameters,
            target: None,
            refused: 0,
            weights: (self.position_weight, self.orientation_weight),
            error: None,
        }))
    }
}

/// A frame that follows poses relative to another frame.
struct Relative {
    task: RelativeTask,
    input: Input<PoseTarget>,
    /// Gain, and weights of position and orientation.
    parameters: [Ramped; 3],
    /// The newest target with a usable orientation.
    target: Option<Isometry3<f64>>,
    /// Number of invalid target poses: the orientation is not a unit quaternion, or a number is not finite.
    refused: u64,
    /// Weights as configured.
    weights: (f64, f64),
    /// Error of the measured robot at the last step: position \[m\], orientation \[rad\].
    error: Option<(f64, f64)>,
}

impl Relative {
    /// The pose of the frame in the other one.
    fn pose(&self, state: &RobotState<'_>) -> Isometry3<f64> {
        let [a, b] = self.task.frames().map(|frame| state.kinematics.pose(state.model, frame));
        a.inv_mul(&b)
    }
}

impl HeldTask for Relative {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.target.is_none() {
            self.task.set_target(self.pose(start));
        }
    }

    fn reset(&mut self) {
        (self.target, self.refused, self.error) = (None, 0, None);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [gain, position_weight, orientation_weight] =
            self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        let gain = gain.min(bounds.max_gain);
        let settings = *self.task.settings();
        self.task.set_settings(RelativeSettings { gain, position_weight, orientation_weight, ..settings });
    }

    fn prepare(&mut self, _: &TaskBounds) {
        let Some(target) = self.input.latest() else { return };
        let Some(target) = pose_of(target.position, target.orientation) else {
            self.refused += 1;
            return;
        };
        self.task.set_target(target);
        self.target = Some(target);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, _: f64) {
        let off = self.pose(measured).inv_mul(self.task.target());
        self.error = Some((off.translation.vector.norm(), off.rotation.angle()));
    }

    fn result(&self) -> Option<serde_json::Value> {
        let (position, orientation) = self.weights;
        Some(serde_json::json!({
            "last_position_error_m": self.error.filter(|_| position > 0.0).map(|(position, _)| position),
            "last_orientation_error_rad": self.error.filter(|_| orientation > 0.0).map(|(_, orientation)| orientation),
            "targets_refused": self.refused,
        }))
    }
}
