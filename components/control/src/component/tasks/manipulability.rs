//! The manipulability task of `control.qp`.

use motorium::prelude::*;
use motorium_robots::TaskRows;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::OnMotions;
use super::{ActsOn, HeldTask, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS};
use crate::tasks::{ManipulabilityTask, Measure};

/// A manipulability task: the joints move to where a frame is moved, or exerts forces, more easily.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ManipulabilityConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "manipulability".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link of the evaluated frame. Default: the robot's only end effector.
    pub frame: Option<String>,
    /// Motions of the frame that count. Default "position".
    pub rows: ManipulabilityRows,
    /// The measure that grows. Default "velocity".
    pub of: Measure,
    /// Speed per slope of the measure, (rad/s)^2, 0 to 1000. Default 1.
    pub gain: f64,
    /// Cost of a joint velocity error, 1/(rad/s), 0 to 1000. Default 1e-2.
    pub weight: f64,
    /// Maximum norm of the commanded joint velocities, rad/s. Default 0.5.
    pub max_speed: f64,
    /// With `inverse_dynamics`: decay rate of joint velocity errors, 1/s, 0 to 1000; limited to half the tick
    /// rate. Default 20.
    pub rate: Option<f64>,
}

/// Motions of a frame that count for its manipulability.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ManipulabilityRows {
    /// The velocity of its origin.
    Position,
    /// Its angular velocity.
    Orientation,
    /// Both; metres and radians are weighed alike.
    Pose,
}

impl Default for ManipulabilityConfig {
    fn default() -> Self {
        Self {
            name: "manipulability".to_owned(),
            level: 1,
            frame: None,
            rows: ManipulabilityRows::Position,
            of: Measure::Velocity,
            gain: 1.0,
            weight: 1e-2,
            max_speed: 0.5,
            rate: None,
        }
    }
}

impl ManipulabilityConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<ManipulabilityTask, ConfigError> {
        let frame = place.frame("manipulability", self.frame.as_deref())?;
        let rows = match self.rows {
            ManipulabilityRows::Position => TaskRows::POSITION,
            ManipulabilityRows::Orientation => TaskRows::ORIENTATION,
            ManipulabilityRows::Pose => TaskRows::POSE,
        };
        let gain = place.in_range("gain", self.gain, WEIGHTS)?;
        let weight = place.in_range("weight", self.weight, WEIGHTS)?;
        let rate = place.rate(self.rate)?;
        let speed = place.in_range("max_speed", self.max_speed, 1e-6..=f64::MAX)?;
        Ok(ManipulabilityTask::new(place.model, frame, rows)
            .with_measure(self.of)
            .with(gain, weight)
            .max_speed(speed)
            .rate(rate))
    }
}

impl TaskKind for ManipulabilityConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).acts_on(ActsOn::Joints)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::new("gain", self.gain, WEIGHTS, "(rad/s)^2", "speed per slope of the measure"),
            TaskParameter::new("weight", self.weight, WEIGHTS, "1/(rad/s)", "cost of a joint velocity error"),
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
        Ok(Box::new(OnMotions {
            task: self.build(place)?,
            parameters: self.open(setup)?,
            apply: |task, [gain, weight], _| task.set(gain, weight),
        }))
    }
}
