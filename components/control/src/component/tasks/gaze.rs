//! The gaze task of `control.qp`.

use motorium::prelude::*;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{GazeSettings, GazeTask, VelocityTask};
use crate::{GoalError, GoalRecord, GoalTolerance, RobotState};

/// Distance of the virtual target used when no target is set, m; large enough that frame motion does not
/// change the direction.
const FAR: f64 = 1e6;

/// A gaze task: an axis of a frame points at a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GazeConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "gaze".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link whose axis points at the target. Default: the robot's only end effector.
    pub frame: Option<String>,
    /// The axis in the axes of the frame, of any length but 0. Default [0, 0, 1].
    pub axis: [f64; 3],
    /// Name of the input port of its target, of which position and linear velocity count. The input is
    /// optional: without a target the axis keeps its direction. Default "gaze_target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 10.
    pub gain: f64,
    /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 1.
    pub weight: f64,
    /// Maximum angular speed of the correction, rad/s. Default: no limit.
    pub max_speed: Option<f64>,
    /// Levenberg-Marquardt damping, s/rad; prevents oscillation if the robot cannot look at the target.
    /// Default: 5e-3, or two tick periods if that is larger.
    pub damping: Option<f64>,
    /// Angle from a goal within which it counts as reached, rad. Default 0.02.
    pub tolerance: f64,
}

impl Default for GazeConfig {
    fn default() -> Self {
        let GazeSettings { gain, weight, .. } = GazeSettings::default();
        Self {
            name: "gaze".to_owned(),
            level: 1,
            frame: None,
            axis: [0.0, 0.0, 1.0],
            target: "gaze_target".to_owned(),
            gain,
            weight,
            max_speed: None,
            damping: None,
            tolerance: GoalTolerance::default().orientation,
        }
    }
}

impl GazeConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<GazeTask, ConfigError> {
        let frame = place.frame("gaze", self.frame.as_deref())?;
        let axis = place.axis("axis", self.axis)?;
        Ok(GazeTask::new(place.model, frame, axis).with(GazeSettings {
            gain: place.in_range("gain", self.gain, GAINS)?,
            weight: place.in_range("weight", self.weight, WEIGHTS)?,
            max_speed: place.max_speed("max_speed", self.max_speed)?,
            damping: place.damping(self.damping, GazeSettings::default().damping)?,
        }))
    }
}

impl TaskKind for GazeConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target)
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
        let doc = "position and linear velocity of the point to look at, in the world frame";
        declare.optional_input::<PoseTarget>(&self.target, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let task = self.build(place)?;
        let input = setup.input(&self.target)?;
        let [gain, weight] = self.open(setup)?;
        Ok(Box::new(Gaze {
            task,
            input,
            gain,
            weight,
            goals: GoalRecord::new(GoalTolerance {
                position: f64::INFINITY,
                orientation: place.tolerance("tolerance", self.tolerance)?,
            }),
            current: None,
        }))
    }
}

/// An axis that points at the positions of one input.
struct Gaze {
    task: GazeTask,
    input: Input<PoseTarget>,
    gain: Ramped,
    weight: Ramped,
    goals: GoalRecord,
    current: Option<PoseTarget>,
}

impl HeldTask for Gaze {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.current.is_none() {
            let pose = start.kinematics.pose(start.model, self.task.frame());
            let ahead = pose.rotation * self.task.axis().into_inner();
            self.task.set_target(pose.translation.vector + ahead * FAR);
        }
    }

    fn reset(&mut self) {
        self.goals.reset();
        self.current = None;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.task.set_settings(GazeSettings {
            gain: self.gain.follow(bounds, fades).min(bounds.max_gain),
            weight: self.weight.follow(bounds, fades),
            ..*self.task.settings()
        });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let Some(reading) = self.input.latest() else { return };
        let (target, fresh) = (*reading, reading.age_ns() <= bounds.target_timeout_ns);
        let velocity = if fresh { Vector3::from(target.linear_velocity) } else { Vector3::zeros() };
        self.task.set_moving_target(Vector3::from(target.position), velocity);
        self.current = Some(target);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, dt: f64) {
        let Some(target) = &self.current else { return };
        let error = GoalError { position: 0.0, orientation: Some(self.task.angle_at(measured)) };
        self.goals.observe(target.goal, target.at_goal != 0, error, dt);
    }

    fn goals(&self) -> Option<&GoalRecord> {
        Some(&self.goals)
    }

    fn result(&self) -> Option<serde_json::Value> {
        let summary = self.goals.summary();
        Some(serde_json::json!({
            "goals_reached": summary.reached,
            "goals_missed": summary.missed,
            "orientation_error_rad": summary.worst.and_then(|error| error.orientation),
            "last_orientation_error_rad": self.goals.latest().and_then(|error| error.orientation),
        }))
    }
}
