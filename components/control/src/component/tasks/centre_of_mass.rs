//! The centre-of-mass task of `control.qp`.

use motorium::prelude::*;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{CentreOfMassSettings, CentreOfMassTask, VelocityTask};
use crate::{GoalError, GoalRecord, GoalTolerance, RobotState};

/// A centre-of-mass task: the centre of mass of the robot follows a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CentreOfMassConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "centre_of_mass".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Name of the input port of its target, of which position and linear velocity count. The input is
    /// optional: without a target the centre of mass stays where it was at the start. Default
    /// "centre_of_mass_target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 10.
    pub gain: f64,
    /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
    pub weight: f64,
    /// Factors of the weight along x, y and z of the world, 0 to 1; 0 leaves an axis free. Default [1, 1, 1].
    pub shares: [f64; 3],
    /// Maximum speed of the correction, m/s. Default: no limit.
    pub max_speed: Option<f64>,
    /// Levenberg-Marquardt damping, s m/rad^2; prevents oscillation if the target is out of reach. Default:
    /// 5e-3, or two tick periods times one metre if that is larger.
    pub damping: Option<f64>,
    /// Distance from a goal, along the controlled axes, within which it counts as reached, m. Default 5e-3.
    pub tolerance: f64,
}

impl Default for CentreOfMassConfig {
    fn default() -> Self {
        let CentreOfMassSettings { gain, weight, shares, .. } = CentreOfMassSettings::default();
        Self {
            name: "centre_of_mass".to_owned(),
            level: 1,
            target: "centre_of_mass_target".to_owned(),
            gain,
            weight,
            shares,
            max_speed: None,
            damping: None,
            tolerance: GoalTolerance::default().position,
        }
    }
}

impl CentreOfMassConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<CentreOfMassTask, ConfigError> {
        let mass: f64 = place.model.bodies().iter().map(|body| body.inertia.mass).sum();
        if mass.is_nan() || mass <= 0.0 {
            let message = format!("robot `{}` has no mass, so no centre of mass", place.model.name());
            return Err(ConfigError::key(&place.path, message));
        }
        for share in self.shares {
            place.in_range("shares", share, 0.0..=1.0)?;
        }
        Ok(CentreOfMassTask::new(place.model).with(CentreOfMassSettings {
            gain: place.in_range("gain", self.gain, GAINS)?,
            weight: place.in_range("weight", self.weight, WEIGHTS)?,
            shares: self.shares,
            max_speed: place.max_speed("max_speed", self.max_speed)?,
            damping: place.damping(self.damping, CentreOfMassSettings::default().damping)?,
        }))
    }
}

impl TaskKind for CentreOfMassConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::gain(self.gain),
            TaskParameter::new("weight", self.weight, WEIGHTS, "1/(m/s)", "cost of a velocity error"),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "position and linear velocity of the centre of mass, in the world frame";
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
        Ok(Box::new(CentreOfMass {
            task,
            input,
            gain,
            weight,
            goals: GoalRecord::new(GoalTolerance {
                position: place.tolerance("tolerance", self.tolerance)?,
                ..GoalTolerance::default()
            }),
            held: self.shares.map(|share| if share == 0.0 { 0.0 } else { 1.0 }).into(),
            current: None,
        }))
    }
}

/// A centre of mass that follows the positions of one input.
struct CentreOfMass {
    task: CentreOfMassTask,
    input: Input<PoseTarget>,
    gain: Ramped,
    weight: Ramped,
    goals: GoalRecord,
    /// 1 for each controlled axis, else 0.
    held: Vector3<f64>,
    current: Option<PoseTarget>,
}

impl HeldTask for CentreOfMass {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.current.is_none() {
            let position = start.kinematics.centre_of_mass(start.model).position;
            self.task.set_target(position);
        }
    }

    fn reset(&mut self) {
        self.goals.reset();
        self.current = None;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.task.set_settings(CentreOfMassSettings {
            gain: self.gain.follow(bounds, fades).min(bounds.max_gain),
            weight: self.weight.follow(bounds, fades),
            ..*self.task.settings()
        });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let Some(reading) = self.input.latest() else { return };
        let (target, fresh) = (*reading, reading.age_ns() <= bounds.target_timeout_ns);
        let velocity = if fresh { Vector3::from(target.linear_velocity) } else { Vector3::zeros() };
        self.task.set_moving_target(Vector3::from(target.position), velocity, Vector3::zeros());
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
        let position = measured.kinematics.centre_of_mass(measured.model).position;
        let error = (self.task.target() - position).component_mul(&self.held);
        let error = GoalError { position: error.norm(), orientation: None };
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
            "position_error_m": summary.worst.map(|error| error.position),
            "last_position_error_m": self.goals.latest().map(|error| error.position),
        }))
    }
}
