//! The `config` table of `control.mpc`.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use motorium_control::with_defaults;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::mpc::{Landing, MpcWeights};

with_defaults! {
    /// Configuration of `control.mpc`. Every key has a default; with an empty table the robot stands on all
    /// feet.
    ///
    /// ```toml
    /// horizon  = { steps = 10, step = "30 ms" }
    /// velocity = [0.3, 0.0, 0.0]
    /// gait.period  = "400 ms"
    /// gait.offsets = { front_left = 0.0, front_right = 0.5, hind_left = 0.5, hind_right = 0.0 }
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct MpcConfig;

    /// Prediction horizon.
    pub horizon: HorizonConfig = HorizonConfig::default();
    /// Interval between two solutions; forces are constant in between. Default: one solution per step.
    pub solve_every: Option<TimeSpan> = None;
    /// Gait. Default: all feet stand.
    pub gait: Option<GaitConfig> = None;
    /// Ground model. Default "level".
    pub ground: GroundConfig = GroundConfig::Level;
    /// Reaction to early and late touchdown. Requires the input `feet`.
    pub landing: LandingConfig = LandingConfig::default();
    /// Weights of the cost terms.
    pub weights: WeightsConfig = WeightsConfig::default();
    /// Commanded velocity if the input `target` is not connected, in heading axes: forward and left, m/s, and
    /// about the vertical, rad/s. Default 0.
    pub velocity: [f64; 3] = [0.0; 3];
    /// Maximum acceleration of the reference, m/s2, and rad/s2 about the vertical, 1e-3 to 1000. Default 1.
    pub acceleration: f64 = 1.0;
    /// Height of the centre of mass above the ground, m, at least 1e-3. Default: the height in the home pose.
    pub height: Option<f64> = None;
    /// Maximum horizontal distance between the reference and the measured centre of mass, m, 1e-3 to 10.
    /// Default 0.05.
    pub max_lead: f64 = 0.05;
    /// Maximum angle between the reference and the measured heading, rad, 1e-3 to 3. Default 0.3.
    pub max_turn: f64 = 0.3;
    /// Coefficient of friction of all feet, 1e-3 to 10. Default: each foot's value in the profile, or 0.6.
    pub friction: Option<f64> = None;
    /// Maximum normal force at a point of a foot, N, at least 1e-3. Default: twice the robot's weight.
    pub max_force: Option<f64> = None;
    /// Gravity along z of the world, m/s2, below 0. Default: the value in `[world]`, or -9.81.
    pub gravity: [f64; 3] = [0.0, 0.0, -9.81];
    /// Maximum age of the robot state. The planner publishes no plan from an older state. Default 20 ms.
    pub state_timeout: TimeSpan = TimeSpan { ns: 20_000_000 };
    /// Age beyond which a target counts as zero velocity. Default 100 ms.
    pub target_timeout: TimeSpan = TimeSpan { ns: 100_000_000 };
}

with_defaults! {
    /// Prediction horizon.
    #[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct HorizonConfig;

    /// Number of steps, 1 to 40. Default 10.
    pub steps: usize = 10;
    /// Duration of a step, 1 ms to 1 s. Default 30 ms.
    pub step: TimeSpan = TimeSpan { ns: 30_000_000 };
}

/// A periodic gait.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaitConfig {
    /// Duration of a stride.
    pub period: TimeSpan,
    /// Fraction of the stride that a foot spends in stance, above 0, below 1. Default 0.5.
    #[serde(default = "half")]
    pub duty: f64,
    /// Phase of the stride at which the stance of each foot of the profile starts, 0 to 1.
    pub offsets: BTreeMap<String, f64>,
    /// Duration of the initial stance on all feet. Default 1 s.
    #[serde(default = "second")]
    pub stand_for: TimeSpan,
    /// Height of a foot at mid-swing, m, 0 to 10. Default 0.05.
    #[serde(default = "clearance")]
    pub clearance: f64,
    /// Maximum correction of a foothold against a velocity error, m, 0 to 10. Default 0.1.
    #[serde(default = "most")]
    pub max_capture: f64,
    /// Duration over which a foot is loaded after touchdown and unloaded before lift-off. Default 10 ms.
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

/// Ground model used by the planner.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(
    rename_all = "snake_case",
    expecting = "expected \"level\", { fitted = { smoothing = TIME } } or { normal = [X, Y, Z] }"
)]
pub enum GroundConfig {
    /// Level, at the mean height of the stance feet.
    Level,
    /// A plane fitted by least squares to the last stance position of each foot. The base is kept parallel to
    /// the plane.
    Fitted(FittedConfig),
    /// A plane through the stance feet with this normal, of any length, in world axes. The base is kept
    /// parallel to the plane.
    Normal([f64; 3]),
}

with_defaults! {
    /// Settings of the fitted ground plane.
    #[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct FittedConfig;

    /// Time constant with which the height and slopes of the plane are smoothed. Default 200 ms.
    pub smoothing: TimeSpan = TimeSpan { ns: 200_000_000 };
}

with_defaults! {
    /// Reaction to early and late touchdown.
    #[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct LandingConfig;

    /// Fraction of a swing after which a contact ends the swing, 0 to 1; 1 disables early touchdown. Default
    /// 0.5.
    pub early_from: f64 = Landing::default().early_from;
    /// Speed at which a foot without contact at the end of its swing is lowered to find the ground, m/s, 0
    /// to 10. Default 0.3.
    pub search_speed: f64 = Landing::default().search_speed;
    /// Maximum duration of the search for the ground, after which the foot counts as standing. Default 80 ms;
    /// 0 disables the search.
    pub search_for: TimeSpan = TimeSpan { ns: (1e9 * Landing::default().search_for).round() as u64 };
}

with_defaults! {
    /// Weights of the cost terms. Vectors are in heading axes: forward, left, up.
    #[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct WeightsConfig;

    /// Weight of the orientation about each axis, 1/rad, 0 to 1e4. Default 1, 1, 1.
    pub turn: [f64; 3] = MpcWeights::default().turn.into();
    /// Weight of the position of the centre of mass, 1/m, 0 to 1e4. Default 10, 10, 20.
    pub position: [f64; 3] = MpcWeights::default().position.into();
    /// Weight of the angular velocity, 1/(rad/s), 0 to 1e4. Default 0.05, 0.05, 0.05.
    pub angular_velocity: [f64; 3] = MpcWeights::default().angular_velocity.into();
    /// Weight of the velocity of the centre of mass, 1/(m/s), 0 to 1e4. Default 0.5, 0.5, 0.5.
    pub velocity: [f64; 3] = MpcWeights::default().velocity.into();
    /// Weight of the deviation of each force from an equal distribution of the robot's weight, in units of
    /// that weight, 1e-6 to 1e4. Default 0.5.
    pub force: f64 = MpcWeights::default().force;
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
