//! The `config` table of `control.mpc`.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::mpc::{Landing, MpcWeights};

/// Configuration of `control.mpc`. Every key has a default: with an empty table the robot stands on all feet.
///
/// ```toml
/// horizon  = { steps = 10, step = "30 ms" }
/// velocity = [0.3, 0.0, 0.0]
/// gait     = { period = "400 ms", offsets = { front_left = 0.0, front_right = 0.5, hind_left = 0.5, hind_right = 0.0 } }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MpcConfig {
    /// Steps that are predicted.
    pub horizon: HorizonConfig,
    /// Time between two solutions, whose forces hold meanwhile. Default: each step of the component has one.
    pub solve_every: Option<TimeSpan>,
    /// Gait. Default: all feet stand.
    pub gait: Option<GaitConfig>,
    /// Knowledge of the ground. Default "level".
    pub ground: GroundConfig,
    /// Reaction to feet that touch before or after their time. It needs the input `feet`.
    pub landing: LandingConfig,
    /// Costs of errors.
    pub weights: WeightsConfig,
    /// Velocity without a target: forward and to the left, m/s, and about the vertical, rad/s, in the axes of the heading. Default 0.
    pub velocity: [f64; 3],
    /// Largest acceleration of the reference, m/s2, and rad/s2 about the vertical, 1e-3 to 1000. Default 1.
    pub acceleration: f64,
    /// Height of the centre of mass above the ground, m, from 1e-3. Default: that of the home pose.
    pub height: Option<f64>,
    /// Largest distance of the reference from the measured centre of mass in the plane, m, 1e-3 to 10. Default 0.05.
    pub max_lead: f64,
    /// Largest angle of the reference from the measured heading, rad, 1e-3 to 3. Default 0.3.
    pub max_turn: f64,
    /// Coefficient of friction of all feet, 1e-3 to 10. Default: that of each foot in the profile, or 0.6.
    pub friction: Option<f64>,
    /// Largest normal force at a point of a foot, N, from 1e-3. Default: twice the robot's weight.
    pub max_force: Option<f64>,
    /// Acceleration of gravity along z of the world, m/s2, below 0. Default: that of `[world]`, -9.81 without one.
    #[serde(default = "gravity")]
    pub gravity: [f64; 3],
    /// Age from which a state is not acted upon: nothing is planned then. Default 20 ms.
    pub state_timeout: TimeSpan,
    /// Age from which a target counts as zero. Default 100 ms.
    pub target_timeout: TimeSpan,
}

fn gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// Steps that are predicted.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HorizonConfig {
    /// Number of steps, 1 to 40. Default 10.
    pub steps: usize,
    /// Time of a step, 1 ms to 1 s. Default 30 ms.
    pub step: TimeSpan,
}

/// A periodic gait.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaitConfig {
    /// Time of a stride.
    pub period: TimeSpan,
    /// Share of the stride for which a foot stands, more than 0, less than 1. Default 0.5.
    #[serde(default = "half")]
    pub duty: f64,
    /// Share of the stride at which each foot of the profile begins to stand, 0 to 1.
    pub offsets: BTreeMap<String, f64>,
    /// Time for which all feet stand at first. Default 1 s.
    #[serde(default = "second")]
    pub stand_for: TimeSpan,
    /// Height by which a foot is lifted half-way, m, 0 to 10. Default 0.05.
    #[serde(default = "clearance")]
    pub clearance: f64,
    /// Largest distance that a step is moved against a velocity error, m, 0 to 10. Default 0.1.
    #[serde(default = "most")]
    pub max_capture: f64,
    /// Time within which a foot is loaded after it lands, and unloaded before it is lifted. Default 10 ms.
    #[serde(default = "ramp")]
    pub ramp: TimeSpan,
}

fn half() -> f64 {
    0.5
}

fn second() -> TimeSpan {
    TimeSpan { ns: 1_000_000_000 }
}

fn clearance() -> f64 {
    0.05
}

fn most() -> f64 {
    0.1
}

fn ramp() -> TimeSpan {
    TimeSpan { ns: 10_000_000 }
}

/// Knowledge of a planner about the ground.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(
    rename_all = "snake_case",
    expecting = "expected \"level\", { fitted = { smoothing = TIME } } or { normal = [X, Y, Z] }"
)]
pub enum GroundConfig {
    /// Level, at the mean height of the feet that stand.
    Level,
    /// A plane through the places at which each foot stood last, by least squares. The base is held parallel to it.
    Fitted(FittedConfig),
    /// A plane of this normal, of any length, through the feet that stand, axes of the world. The base is held parallel to it.
    Normal([f64; 3]),
}

/// Settings of a ground that is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FittedConfig {
    /// Time constant of its height and slopes. Default 200 ms.
    pub smoothing: TimeSpan,
}

impl Default for FittedConfig {
    fn default() -> Self {
        Self { smoothing: TimeSpan { ns: 200_000_000 } }
    }
}

/// Reaction to feet that touch before or after their time.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LandingConfig {
    /// Share of a swing from which a contact ends it, 0 to 1; 1 for never. Default 0.5.
    pub early_from: f64,
    /// Speed at which a foot that has not touched at the end of its swing is moved on into the ground, m/s, 0 to 10. Default 0.3.
    pub search_speed: f64,
    /// Longest time for which it is; it then counts as standing all the same. Default 80 ms; 0: never.
    pub search_for: TimeSpan,
}

impl Default for LandingConfig {
    fn default() -> Self {
        let Landing { early_from, search_speed, search_for } = Landing::default();
        let search_for = TimeSpan { ns: (1e9 * search_for).round() as u64 };
        Self { early_from, search_speed, search_for }
    }
}

/// Costs of errors, each for three axes: along the heading, across it, up.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WeightsConfig {
    /// Of the orientation about each axis, 1/rad, 0 to 1e4. Default 1, 1, 1.
    pub turn: [f64; 3],
    /// Of the centre of mass, 1/m, 0 to 1e4. Default 10, 10, 20.
    pub position: [f64; 3],
    /// Of the angular velocity, 1/(rad/s), 0 to 1e4. Default 0.05, 0.05, 0.05.
    pub angular_velocity: [f64; 3],
    /// Of the velocity of the centre of mass, 1/(m/s), 0 to 1e4. Default 0.5, 0.5, 0.5.
    pub velocity: [f64; 3],
    /// Of the difference of a force from its share of the weight, in weights of the robot, 1e-6 to 1e4. Default 0.5.
    pub force: f64,
}

impl Default for WeightsConfig {
    fn default() -> Self {
        let MpcWeights { turn, position, angular_velocity, velocity, force } = MpcWeights::default();
        Self {
            turn: turn.into(),
            position: position.into(),
            angular_velocity: angular_velocity.into(),
            velocity: velocity.into(),
            force,
        }
    }
}

impl WeightsConfig {
    pub(super) fn weights(&self) -> MpcWeights {
        MpcWeights {
            turn: self.turn.into(),
            position: self.position.into(),
            angular_velocity: self.angular_velocity.into(),
            velocity: self.velocity.into(),
            force: self.force,
        }
    }
}

impl Default for HorizonConfig {
    fn default() -> Self {
        Self { steps: 10, step: TimeSpan { ns: 30_000_000 } }
    }
}

impl Default for MpcConfig {
    fn default() -> Self {
        Self {
            horizon: HorizonConfig::default(),
            solve_every: None,
            gait: None,
            ground: GroundConfig::Level,
            landing: LandingConfig::default(),
            weights: WeightsConfig::default(),
            velocity: [0.0; 3],
            acceleration: 1.0,
            height: None,
            max_lead: 0.05,
            max_turn: 0.3,
            friction: None,
            max_force: None,
            gravity: gravity(),
            state_timeout: TimeSpan { ns: 20_000_000 },
            target_timeout: TimeSpan { ns: 100_000_000 },
        }
    }
}
