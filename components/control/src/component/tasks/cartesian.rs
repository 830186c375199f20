//! The Cartesian task of `control.qp`.

use motorium::prelude::*;
use motorium_robots::Twist;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::impedance::{CartesianImpedanceConfig, Gain};
use super::{
    AxesConfig, Fades, GAINS, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace,
    WEIGHTS,
};
use crate::component::checks::pose_of;
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::{CartesianImpedance, CartesianSettings, CartesianTask, VelocityTask};
use crate::{GoalError, GoalRecord, GoalTolerance, RobotState};

/// A Cartesian task: a frame follows a pose target.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CartesianConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "cartesian".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Link whose frame follows the target. Default: the robot's only end effector.
    pub frame: Option<String>,
    /// Name of the input port of its target. Without a target the frame stays where it was at the start.
    /// Default "target".
    pub target: String,
    /// Rate at which the error decays, 1/s, 0 to 1000; at most half the tick rate is used. Default 10.
    pub gain: f64,
    /// Spring and damper replacing the gain. Default: none.
    pub impedance: Option<CartesianImpedanceConfig>,
    /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
    pub position_weight: f64,
    /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
    pub orientation_weight: f64,
    /// Contact of `inverse_dynamics`, such as a foot: the task is active only while it is lifted. Default:
    /// always active.
    pub while_lifted: Option<String>,
    /// Factors of both weights per axis; an axis without a factor is free. Default: all axes.
    pub axes: Option<AxesConfig>,
    /// Maximum linear speed of the correction, m/s. Default: no limit.
    pub max_linear_speed: Option<f64>,
    /// Maximum angular speed of the correction, rad/s. Default: no limit.
    pub max_angular_speed: Option<f64>,
    /// Levenberg-Marquardt damping, s m/rad^2; prevents oscillation if the target is out of reach. Default:
    /// 5e-3, or two tick periods times one metre if that is larger.
    pub damping: Option<f64>,
    /// Distance from a goal within which it counts as reached, m. Default 5e-3; unlimited if
    /// `position_weight` is 0.
    pub position_tolerance: f64,
    /// Angle from a goal within which it counts as reached, rad. Default 0.02; unlimited if
    /// `orientation_weight` is 0.
    pub orientation_tolerance: f64,
}

impl Default for CartesianConfig {
    fn default() -> Self {
        let settings = CartesianSettings::default();
        Self {
            name: "cartesian".to_owned(),
            level: 1,
            frame: None,
            target: "target".to_owned(),
            gain: settings.gain,
            impedance: None,
            position_weight: settings.position_weight,
            orientation_weight: settings.orientation_weight,
            while_lifted: None,
            axes: None,
            max_linear_speed: None,
            max_angular_speed: None,
            damping: None,
            position_tolerance: GoalTolerance::default().position,
            orientation_tolerance: GoalTolerance::default().orientation,
        }
    }
}

impl CartesianConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<CartesianTask, ConfigError> {
        let model = place.model;
        let frame = place.frame("cartesian", self.frame.as_deref())?;
        let weight = |name, weight| place.in_range(name, weight, WEIGHTS);
        let settings = CartesianSettings {
            error: place.pose_error(),
            gain: place.in_range("gain", self.gain, GAINS)?,
            position_weight: weight("position_weight", self.position_weight)?,
            orientation_weight: weight("orientation_weight", self.orientation_weight)?,
            max_linear_speed: place.max_speed("max_linear_speed", self.max_linear_speed)?,
            max_angular_speed: place.max_speed("max_angular_speed", self.max_angular_speed)?,
            damping: place.damping(self.damping, CartesianSettings::default().damping)?,
            shares: self.axes.as_ref().map(|axes| axes.shares(place)).transpose()?,
        };
        Ok(CartesianTask::new(model, frame).with(settings))
    }

    /// Returns the contact during whose lift the task is active.
    fn lifted(&self, place: &TaskPlace<'_>) -> Result<Option<usize>, ConfigError> {
        self.while_lifted.as_ref().map(|name| place.contact("while_lifted", name)).transpose()
    }

    /// Spring and damper, if configured.
    fn spring(&self, place: &TaskPlace<'_>) -> Result<Option<CartesianImpedance>, ConfigError> {
        let gain = || Gain { given: self.gain, default: CartesianSettings::default().gain };
        self.impedance.as_ref().map(|impedance| impedance.build(place, gain())).transpose()
    }

    /// Tolerance of the goals; free directions cannot miss.
    fn tolerance(&self, place: &TaskPlace<'_>) -> Result<GoalTolerance, ConfigError> {
        let of = |name, tolerance, counts| {
            let tolerance = place.tolerance(name, tolerance)?;
            Ok(if counts { tolerance } else { f64::INFINITY })
        };
        let shares = self.axes.as_ref().map(|axes| axes.shares(place)).transpose()?;
        let position = self.position_weight > 0.0 && shares.is_none_or(|shares| shares.has_position());
        let orientation =
            self.orientation_weight > 0.0 && shares.is_none_or(|shares| shares.has_orientation());
        Ok(GoalTolerance {
            position: of("position_tolerance", self.position_tolerance, position)?,
            orientation: of("orientation_tolerance", self.orientation_tolerance, orientation)?,
        })
    }
}

impl TaskKind for CartesianConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).target(&self.target)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        let weights = [
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
        ];
        match &self.impedance {
            None => std::iter::once(TaskParameter::gain(self.gain)).chain(weights).collect(),
            Some(impedance) => impedance.parameters().into_iter().chain(weights).collect(),
        }
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        self.lifted(place)?;
        self.tolerance(place)?;
        self.spring(place)?;
        declare.input::<PoseTarget>(&self.target, "pose and velocity of the frame, in the world frame");
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let task = self.build(place)?;
        let input = setup.input(&self.target)?;
        let spring = self.spring(place)?;
        let (task, pull, [position_weight, orientation_weight]) = match spring {
            None => {
                let [gain, position, orientation] = self.open(setup)?;
                (task, Pull::Gain(gain), [position, orientation])
            }
            Some(spring) => {
                let [stiffness, damping, position, orientation] = self.open(setup)?;
                let task = task.impedance(place.model, spring);
                (task, Pull::Spring { spring, stiffness, damping }, [position, orientation])
            }
        };
        Ok(Box::new(Cartesian {
            task,
            input,
            pull,
            position_weight,
            orientation_weight,
            lifted: self.lifted(place)?,
            goals: GoalRecord::new(self.tolerance(place)?),
            current: None,
            refused: 0,
        }))
    }
}

/// The pull of an error.
enum Pull {
    /// Rate of decay of the error.
    Gain(Ramped),
    /// A spring and a damper, with parameters of the position.
    Spring { spring: CartesianImpedance, stiffness: Ramped, damping: Ramped },
}

/// A frame that follows the poses of one input.
struct Cartesian {
    task: CartesianTask,
    input: Input<PoseTarget>,
    pull: Pull,
    position_weight: Ramped,
    orientation_weight: Ramped,
    /// Contact during whose lift the task is active.
    lifted: Option<usize>,
    goals: GoalRecord,
    /// The newest target with a usable orientation.
    current: Option<PoseTarget>,
    /// Number of invalid target poses: the orientation is not a unit quaternion, or a number is not finite.
    refused: u64,
}

impl Cartesian {
    /// True for the position, and for the orientation, if it is controlled.
    fn counts(&self) -> (bool, bool) {
        let CartesianSettings { position_weight, orientation_weight, shares, .. } = *self.task.settings();
        (
            position_weight > 0.0 && shares.is_none_or(|shares| shares.has_position()),
            orientation_weight > 0.0 && shares.is_none_or(|shares| shares.has_orientation()),
        )
    }
}

impl HeldTask for Cartesian {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.current.is_none() {
            let pose = start.kinematics.pose(start.model, self.task.frame());
            self.task.set_target(pose);
        }
    }

    fn reset(&mut self) {
        self.goals.reset();
        (self.current, self.refused) = (None, 0);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let gain = match &mut self.pull {
            Pull::Gain(gain) => gain.follow(bounds, fades).min(bounds.max_gain),
            Pull::Spring { spring, stiffness, damping } => {
                spring.stiffness = stiffness.follow(bounds, fades);
                spring.damping = damping.follow(bounds, fades);
                self.task.set_impedance(*spring);
                self.task.settings().gain
            }
        };
        self.task.set_settings(CartesianSettings {
            gain,
            position_weight: self.position_weight.follow(bounds, fades),
            orientation_weight: self.orientation_weight.follow(bounds, fades),
            ..*self.task.settings()
        });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        let Some(reading) = self.input.latest() else { return };
        let (target, fresh) = (*reading, reading.age_ns() <= bounds.target_timeout_ns);
        let moves = target.linear_velocity.iter().chain(&target.angular_velocity);
        let finite = moves.copied().all(f64::is_finite);
        let Some(pose) = pose_of(target.position, target.orientation).filter(|_| finite) else {
            self.refused += 1;
            return;
        };
        let velocity = Twist {
            linear: Vector3::from(target.linear_velocity),
            angular: Vector3::from(target.angular_velocity),
        };
        let velocity = if fresh { velocity } else { Twist::zero() };
        self.task.set_moving_target(pose, velocity, Twist::zero());
        self.current = Some(target);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        Some(&mut self.task)
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }

    fn while_lifted(&self) -> Option<usize> {
        self.lifted
    }

    fn record(&mut self, measured: &RobotState<'_>, dt: f64) {
        let Some(target) = &self.current else { return };
        let pose = measured.kinematics.pose(measured.model, self.task.frame());
        let settings = self.task.settings();
        // free directions have no error
        let wanted = self.task.target();
        let (position, orientation) = match &settings.shares {
            Some(shares) => {
                let (position, turn) = shares.error(&pose, wanted);
                (position.norm(), turn.norm())
            }
            None => {
                let position = wanted.translation.vector - pose.translation.vector;
                (position.norm(), pose.rotation.angle_to(&wanted.rotation))
            }
        };
        let (moved, turned) = self.counts();
        let position = if moved { position } else { 0.0 };
        let orientation = turned.then_some(orientation);
        let error = GoalError { position, orientation };
        self.goals.observe(target.goal, target.at_goal != 0, error, dt);
    }

    fn goals(&self) -> Option<&GoalRecord> {
        Some(&self.goals)
    }

    fn result(&self) -> Option<serde_json::Value> {
        let summary = self.goals.summary();
        let latest = self.goals.latest();
        let position = |error: GoalError| self.counts().0.then_some(error.position);
        Some(serde_json::json!({
            "goals_reached": summary.reached,
            "goals_missed": summary.missed,
            "position_error_m": summary.worst.and_then(position),
            "orientation_error_rad": summary.worst.and_then(|error| error.orientation),
            "last_position_error_m": latest.and_then(position),
            "last_orientation_error_rad": latest.and_then(|error| error.orientation),
            "targets_refused": self.refused,
        }))
    }
}
