//! The `config` table of `policy.waypoints`.

use motorium::units::TimeSpan;
use motorium_primitives::reach::Repeat;
use schemars::JsonSchema;
use serde::Deserialize;

/// Configuration of `policy.waypoints`.
///
/// ```toml
/// goals = [
///     { position = [2.0, 0.0], yaw = 1.5708 },
///     { position = [2.0, 2.0], dwell = "1 s" },
/// ]
/// speed = 0.15
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaypointsConfig {
    /// Goals in order.
    pub goals: Vec<WaypointConfig>,
    /// Behaviour after the last goal: "once" stays at this goal, "forever" returns to the first goal.
    #[serde(default)]
    pub repeat: Repeat,
    /// Maximum speed, m/s. Default: 80 % of the speed that the robot's wheels can reach, at most 0.5.
    #[serde(default)]
    pub speed: Option<f64>,
    /// Maximum acceleration, m/s^2. Default 0.5.
    #[serde(default = "half")]
    pub acceleration: f64,
    /// Maximum jerk, m/s^3. Default 5.
    #[serde(default = "five")]
    pub jerk: f64,
    /// Maximum yaw rate, rad/s. Default: 80 % of the rate that the robot's wheels can reach, at most 1.
    #[serde(default)]
    pub turn_speed: Option<f64>,
    /// Maximum angular acceleration, rad/s^2. Default 2.
    #[serde(default = "two")]
    pub turn_acceleration: f64,
    /// Maximum angular jerk, rad/s^3. Default 20.
    #[serde(default = "twenty")]
    pub turn_jerk: f64,
    /// Gain of the position correction, 1/s. Default 2.
    #[serde(default = "two")]
    pub gain: f64,
    /// Gain of the angle correction, 1/s. Default 4.
    #[serde(default = "four")]
    pub turn_gain: f64,
    /// Distance within which a base that cannot move sideways returns to its line, m. Default 0.1.
    #[serde(default = "tenth")]
    pub length: f64,
    /// Maximum distance from a goal at which the goal counts as reached, m. Default 0.02.
    #[serde(default = "two_hundredths")]
    pub position_tolerance: f64,
    /// Maximum angle from a goal at which the goal counts as reached, rad. Default 0.0175, which is 1 degree.
    #[serde(default = "degree")]
    pub yaw_tolerance: f64,
    /// Maximum delay at a goal, after which the goal counts as missed and the next goal starts. Default 2 s.
    #[serde(default = "grace")]
    pub grace: TimeSpan,
}

/// A planar goal of the base.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaypointConfig {
    /// Position x and y in the world, m.
    pub position: [f64; 2],
    /// Angle about z at the goal, rad. Default: the angle at which the base arrives.
    #[serde(default)]
    pub yaw: Option<f64>,
    /// Time to stay at the goal. Default 200 ms.
    #[serde(default = "dwell")]
    pub dwell: TimeSpan,
}

fn half() -> f64 {
    0.5
}

fn two() -> f64 {
    2.0
}

fn four() -> f64 {
    4.0
}

fn five() -> f64 {
    5.0
}

fn twenty() -> f64 {
    20.0
}

fn tenth() -> f64 {
    0.1
}

fn two_hundredths() -> f64 {
    0.02
}

fn degree() -> f64 {
    0.0175
}

fn grace() -> TimeSpan {
    TimeSpan { ns: 2_000_000_000 }
}

fn dwell() -> TimeSpan {
    TimeSpan { ns: 200_000_000 }
}
