//! The relative task of `control.qp`.

use motorium::prelude::*;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Formulations, GAINS, HeldTask, TaskBounds, TaskKind, TaskPlace, WEIGHTS};
use crate::RobotState;
use crate::tasks::{RelativeSettings, RelativeTask, Task};

/// A relative task: a frame reaches a pose in another frame of the same robot.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RelativeConfig {
    /// Name of the task, with which the names of its parameters begin. Default "relative".
    pub name: String,
    /// Level of the task, 1 to 8: it decides only what the tasks of smaller numbers leave open. Default 1.
    pub level: u32,
    /// Link whose frame moves. Default: that of the robot's only end effector.
    pub frame: Option<String>,
    /// Link in whose frame the target is given.
    pub other: String,
    /// Name of the input port of its target, whose pose is that of `frame` in `other` and whose velocity does not count. Without a
    /// target the pose stays that of the start. Default "relative_target".
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
        let RelativeSettings { gain, position_weight, orientation_weight } = RelativeSettings::default();
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
            gain: place.in_range("gain", self.gain, GAINS)?,
            position_weight: place.in_range("position_weight", self.position_weight, WEIGHTS)?,
            orientation_weight: place.in_range("orientation_weight", self.orientation_weight, WEIGHTS)?,
        }))
    }
}

impl TaskKind for RelativeConfig {
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
        declare.optional_input::<PoseTarget>(&self.target, "pose of the frame in the other frame");
        let name = |parameter: &str| format!("{}_{parameter}", self.name);
        declare.float(&name("gain"), self.gain, GAINS, "1/s", "rate at which the error decays");
        let (weight, doc) = (self.position_weight, "cost of a velocity error");
        declare.float(&name("position_weight"), weight, WEIGHTS, "1/(m/s)", doc);
        let (weight, doc) = (self.orientation_weight, "cost of an angular velocity error");
        declare.float(&name("orientation_weight"), weight, WEIGHTS, "1/(rad/s)", doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let parameter = |name: &str| setup.parameter(&format!("{}_{name}", self.name));
        let [gain, position, orientation] =
            [parameter("gain")?, parameter("position_weight")?, parameter("orientation_weight")?];
        Ok(Box::new(Relative {
            task: self.build(place)?,
            input: setup.input(&self.target)?,
            gain,
            position,
            orientation,
            has_target: false,
            refused: 0,
            weights: (self.position_weight, self.orientation_weight),
            error: None,
        }))
    }
}

/// A frame that follows poses in another.
struct Relative {
    task: RelativeTask,
    input: Input<PoseTarget>,
    gain: Parameter<f64>,
    position: Parameter<f64>,
    orientation: Parameter<f64>,
    has_target: bool,
    /// Targets whose orientation is no unit quaternion.
    refused: u64,
    /// Weights as configured.
    weights: (f64, f64),
    /// Error of the measured robot at the last step: position \[m\], orientation \[rad\].
    error: Option<(f64, f64)>,
}

impl HeldTask for Relative {
    fn begin(&mut self, start: &RobotState<'_>) {
        if !self.has_target {
            let (a, b) = self.task.frames();
            let [a, b] = [a, b].map(|frame| start.kinematics.pose(start.model, frame));
            self.task.set_target(a.inv_mul(&b));
        }
    }

    fn reset(&mut self) {
        (self.has_target, self.refused, self.error) = (false, 0, None);
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        self.task.set_settings(RelativeSettings {
            gain: self.gain.get().min(bounds.max_gain),
            position_weight: self.position.get(),
            orientation_weight: self.orientation.get(),
        });
        let Some(target) = self.input.latest() else { return };
        let [x, y, z, w] = target.orientation;
        // half the length of a unit quaternion is no rounding error: such a target is refused
        let Some(rotation) = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.5) else {
            self.refused += 1;
            return;
        };
        self.task.set_target(Isometry3::from_parts(Translation3::from(target.position), rotation));
        self.has_target = true;
    }

    fn task(&mut self) -> Option<&mut dyn Task> {
        Some(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, _: f64) {
        let (a, b) = self.task.frames();
        let [a, b] = [a, b].map(|frame| measured.kinematics.pose(measured.model, frame));
        let off = a.inv_mul(&b).inv_mul(self.task.target());
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
