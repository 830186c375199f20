//! The `config` table of `control.qp`.

use std::time::Duration;

use motorium::units::{TimeSpan, UnitError};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::{
    limits::{PositionLimit, VelocityLimit},
    tasks::{CartesianSettings, PostureSettings},
};

/// Configuration of `control.qp`. Every key has a default: for a robot of the catalogue the table may stay empty.
///
/// ```toml
/// tasks = [
///     { cartesian = { frame = "panda_hand_tcp", gain = 10.0 } },
///     { posture = { pose = "ready", weight = 1e-3 } },
/// ]
/// limits = { position = { margin = 0.02 }, velocity = { fraction = 0.8 } }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QpControllerConfig {
    /// What the robot should do, as a weighted sum. Default: the only end effector follows `target`, the joints stay
    /// near the home pose.
    pub tasks: Vec<TaskConfig>,
    /// What it must never do.
    pub limits: LimitsConfig,
    /// Stiffness of the joints, Nm/rad or N/m: one number, or one per joint. Default: that of the robot's profile.
    pub kp: Option<PerJoint>,
    /// Damping of the joints, Nms/rad or Ns/m: one number, or one per joint. Default: that of the robot's profile.
    pub kd: Option<PerJoint>,
    /// Whether the weight of the robot is compensated by a feed-forward effort.
    pub gravity_compensation: bool,
    /// Whether the efforts that accelerate the robot as the setpoint does are fed forward.
    pub inertia_compensation: bool,
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// Which joint positions the tasks are evaluated at.
    pub feedback: Feedback,
    /// How far the position setpoint may be ahead of the measured position, rad or m: what a blocked joint is pushed
    /// with at most, divided by its stiffness.
    pub max_lead: f64,
    /// Tikhonov regularisation of the joint velocity, 1/(rad/s)^2.
    pub damping: f64,
    /// Age from which a joint state is not acted upon: nothing is commanded then, and the drives go to their safe
    /// state.
    #[serde(deserialize_with = "time")]
    #[schemars(with = "TimeSpan")]
    pub state_timeout: Duration,
    /// Age from which a target counts as standing still where it was.
    #[serde(deserialize_with = "time")]
    #[schemars(with = "TimeSpan")]
    pub target_timeout: Duration,
}

impl Default for QpControllerConfig {
    fn default() -> Self {
        Self {
            tasks: Vec::new(),
            limits: LimitsConfig::default(),
            kp: None,
            kd: None,
            gravity_compensation: true,
            inertia_compensation: false,
            gravity: [0.0, 0.0, -9.81],
            feedback: Feedback::Measured,
            max_lead: 0.1,
            damping: 1e-7,
            state_timeout: Duration::from_millis(10),
            target_timeout: Duration::from_millis(50),
        }
    }
}

/// Which joint positions the tasks are evaluated at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// The measured ones: errors of the drives are corrected.
    Measured,
    /// The commanded ones: noise of the sensors does not come back, errors of the drives remain.
    Setpoint,
}

/// One task.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TaskConfig {
    /// A frame follows a pose target.
    Cartesian(CartesianConfig),
    /// The joints keep a posture.
    Posture(PostureConfig),
}

/// A frame follows a pose target.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CartesianConfig {
    /// Name of the task, which begins the names of its parameters.
    pub name: String,
    /// Link whose frame is led. Default: that of the robot's only end effector.
    pub frame: Option<String>,
    /// Name of the input port its target comes from. Without a target the frame stays where it was found.
    pub target: String,
    /// Rate at which the error decays, 1/s; at most half the tick rate is used.
    pub gain: f64,
    /// Cost of a velocity error, 1/(m/s).
    pub position_weight: f64,
    /// Cost of an angular velocity error, 1/(rad/s).
    pub orientation_weight: f64,
    /// Largest speed at which an error is corrected, m/s. Default: none.
    pub max_linear_speed: Option<f64>,
    /// Largest angular speed at which an error is corrected, rad/s. Default: none.
    pub max_angular_speed: Option<f64>,
    /// Levenberg-Marquardt damping, s m/rad^2: keeps the robot calm where the target is out of reach. Default: 5e-3, or
    /// two ticks times one metre where that is more.
    pub damping: Option<f64>,
}

impl Default for CartesianConfig {
    fn default() -> Self {
        let settings = CartesianSettings::default();
        Self {
            name: "cartesian".to_owned(),
            frame: None,
            target: "target".to_owned(),
            gain: settings.gain,
            position_weight: settings.position_weight,
            orientation_weight: settings.orientation_weight,
            max_linear_speed: None,
            max_angular_speed: None,
            damping: None,
        }
    }
}

/// The joints keep a posture.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PostureConfig {
    /// Name of the task, which begins the names of its parameters.
    pub name: String,
    /// A pose of the robot's profile. Default: its home pose, or where the robot was found if it has no profile.
    pub pose: Option<String>,
    /// The posture itself, rad or m, one number per joint. This or `pose`.
    pub positions: Option<Vec<f64>>,
    /// Rate at which the error decays, 1/s; at most half the tick rate is used.
    pub gain: f64,
    /// Cost of a joint velocity error, 1/(rad/s) or 1/(m/s).
    pub weight: f64,
}

impl Default for PostureConfig {
    fn default() -> Self {
        let PostureSettings { gain, weight } = PostureSettings::default();
        Self { name: "posture".to_owned(), pose: None, positions: None, gain, weight }
    }
}

/// What the robot must never do. Both limits always hold.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LimitsConfig {
    /// Joint positions.
    pub position: PositionLimitConfig,
    /// Joint velocities.
    pub velocity: VelocityLimitConfig,
}

/// How joints approach their position limits.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PositionLimitConfig {
    /// Share of the remaining distance that may be covered per second, 1/s.
    pub rate: f64,
    /// Distance kept from the limits of the robot, rad or m.
    pub margin: f64,
}

impl Default for PositionLimitConfig {
    fn default() -> Self {
        let PositionLimit { rate, margin } = PositionLimit::default();
        Self { rate, margin }
    }
}

/// How fast joints may be.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VelocityLimitConfig {
    /// Fraction of the robot's velocity limits that may be used, more than 0, at most 1.
    pub fraction: f64,
}

impl Default for VelocityLimitConfig {
    fn default() -> Self {
        Self { fraction: VelocityLimit::default().fraction }
    }
}

/// One number for all joints, or one for each.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerJoint {
    /// The same for all.
    All(f64),
    /// One per independent joint, in the order of the model's `q`.
    Each(Vec<f64>),
}

fn time<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
    let text = String::deserialize(deserializer)?;
    let span: TimeSpan = text.parse().map_err(|error: UnitError| {
        serde::de::Error::custom(format!("the time {}: {}", error.found, error.expected))
    })?;
    Ok(Duration::from_nanos(span.ns))
}
