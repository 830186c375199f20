//! The capture-point task of `control.qp`.

use motorium::prelude::*;
use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Fades, Formulations, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace,
    WEIGHTS,
};
use crate::RobotState;
use crate::inverse_dynamics::tasks::{AccelerationTask, CapturePoint};

/// A capture-point task: the point where the robot would have to step to come to rest follows a point on the
/// ground.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CapturePointConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "capture_point".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Name of the input port of its target, of which x and y of position and linear velocity count. The
    /// input is optional: without a target the point stays below where the centre of mass was at the start.
    /// Default "capture_point_target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 3.
    pub gain: f64,
    /// Cost of an acceleration error of the centre of mass, 1/(m/s2), 0 to 1000. Default 1.
    pub weight: f64,
}

impl Default for CapturePointConfig {
    fn default() -> Self {
        Self {
            name: "capture_point".to_owned(),
            level: 1,
            target: "capture_point_target".to_owned(),
            gain: 3.0,
            weight: 1.0,
        }
    }
}

impl CapturePointConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<CapturePoint, ConfigError> {
        let gain = place.in_range("gain", self.gain, GAINS)?;
        let weight = place.in_range("weight", self.weight, WEIGHTS)?;
        Ok(CapturePoint::new(place.model, gain).weight(weight))
    }
}

impl TaskKind for CapturePointConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target).only(Formulations::Torque)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::gain(self.gain),
            TaskParameter::new(
                "weight",
                self.weight,
                WEIGHTS,
                "1/(m/s2)",
                "cost of an acceleration error of the centre of mass",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "position and linear velocity of the capture point on the ground, in the world frame";
        declare.optional_input::<PoseTarget>(&self.target, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let task = self.build(place)?;
        let [gain, weight] = self.open(setup)?;
        Ok(Box::new(HeldCapturePoint {
            task,
            input: setup.input(&self.target)?,
            gain,
            weight,
            targeted: false,
            largest: 0.0,
        }))
    }
}

/// A capture point that follows the positions of one input.
struct HeldCapturePoint {
    task: CapturePoint,
    input: Input<PoseTarget>,
    gain: Ramped,
    weight: Ramped,
    /// True since the first target.
    targeted: bool,
    /// Largest distance from the target so far, m.
    largest: f64,
}

impl HeldTask for HeldCapturePoint {
    fn begin(&mut self, start: &RobotState<'_>) {
        if !self.targeted {
            self.task.set_target(start.kinematics.centre_of_mass(start.model).position.xy());
        }
    }

    fn reset(&mut self) {
        (self.targeted, self.largest) = (false, 0.0);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.task
            .set(self.gain.follow(bounds, fades).min(bounds.max_gain), self.weight.follow(bounds, fades));
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let Some(reading) = self.input.latest() else { return };
        let fresh = reading.age_ns() <= bounds.target_timeout_ns;
        let velocity = if fresh { Vector3::from(reading.linear_velocity).xy() } else { Vector2::zeros() };
        self.task.set_moving_target(Vector3::from(reading.position).xy(), velocity);
        self.targeted = true;
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn record(&mut self, _: &RobotState<'_>, _: f64) {
        self.largest = self.largest.max(self.task.error().norm());
    }

    fn result(&self) -> Option<serde_json::Value> {
        let point = self.task.point();
        Some(serde_json::json!({
            "largest_error_m": self.largest,
            "last_error_m": self.task.error().norm(),
            "last_point": [point.x, point.y],
        }))
    }
}
