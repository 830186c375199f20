//! The `config` table of `policy.dmp`.

use motorium::component::TakeWeights;
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use motorium_primitives::dmp::{ObstacleAvoidance, StoredModel};
use motorium_primitives::reach::Repeat;

/// Configuration of `policy.dmp`.
///
/// ```toml
/// repeat = "forever"
/// goals = [
///     { position = [0.5, 0.2, 0.3], duration = "2 s", dwell = "500 ms" },
///     { offset = [0.0, -0.4, 0.0], rpy = [3.14, 0.0, 0.8], duration = "2 s", shape = { arc = [0.0, 0.0, 0.1] } },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DmpPolicyConfig {
    /// The goals, in their order.
    pub goals: Vec<GoalConfig>,
    /// Behaviour after the last goal: "once" stays there, "forever" goes back to the first.
    #[serde(default)]
    pub repeat: Repeat,
    /// Frame of the robot that moves in the plane. Without it, that of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// Pose to start from, in the world frame. Without it, the end effector's measured pose, from the input
    /// `joint_state`.
    #[serde(default)]
    pub start: Option<PoseConfig>,
    /// Primitives of which the parameter `primitive` chooses one for all goals with the shape "selected":
    /// files that `motorium primitive fit` wrote, relative to the graph file.
    #[serde(default)]
    #[schemars(extend("format" = "path"))]
    pub primitives: Vec<String>,
    /// Moment at which weights from the input `weights` are taken, for goals with the shape "weights".
    /// Default "step".
    #[serde(default)]
    pub take_weights: TakeWeights,
    /// Slow-down of the movement while the end effector cannot follow. Default none.
    #[serde(default)]
    pub phase_stop: Option<PhaseStopConfig>,
    /// Points that the movement steers round. Default none.
    #[serde(default)]
    pub obstacles: Option<ObstaclesConfig>,
    /// Giving way to the force of the input `wrench`, as a mass would. Default none.
    #[serde(default)]
    pub yielding: Option<YieldingConfig>,
}

/// A pose in the world frame.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseConfig {
    /// Position, m.
    pub position: [f64; 3],
    /// Orientation as a quaternion, x y z w. This or `rpy`.
    #[serde(default)]
    pub orientation: Option<[f64; 4]>,
    /// Orientation as roll, pitch, yaw about the fixed axes x, y, z, in this order, rad. This or
    /// `orientation`.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
}

/// One goal and the way there.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalConfig {
    /// Position in the world frame, m. This or `offset`; after a demonstration, neither: where it ended.
    #[serde(default)]
    pub position: Option<[f64; 3]>,
    /// Position relative to the goal before, or to the start for the first one, in world axes, m. This or
    /// `position`.
    #[serde(default)]
    pub offset: Option<[f64; 3]>,
    /// Orientation in the world frame as a quaternion, x y z w. Without it and `rpy`, that of the goal
    /// before.
    #[serde(default)]
    pub orientation: Option<[f64; 4]>,
    /// Orientation in the world frame as roll, pitch, yaw about the fixed axes x, y, z, in this order, rad.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
    /// Time to get there, at least 1 ms, such as "2 s". Required, but for a demonstration, which brings its
    /// own.
    #[serde(default)]
    pub duration: Option<TimeSpan>,
    /// Time to stay there, such as "500 ms". Default none.
    #[serde(default)]
    pub dwell: TimeSpan,
    /// The way of the position. Default straight.
    #[serde(default)]
    pub shape: ShapeConfig,
}

/// The way of the position to a goal.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShapeConfig {
    /// The straight line.
    #[default]
    Straight,
    /// An arc, off the straight line by so much half way: world axes, m.
    Arc([f64; 3]),
    /// A primitive of three dimensions, as it was fitted to a demonstration.
    Primitive(StoredModel),
    /// A primitive from a file that `motorium primitive fit` wrote, relative to the graph file.
    File(#[schemars(extend("format" = "path"))] String),
    /// A primitive fitted to a recording when the component is configured.
    Demonstration(DemonstrationConfig),
    /// The one of `primitives` that the parameter `primitive` chooses, from the next start for this goal.
    Selected,
    /// A primitive whose weights come from the input `weights`.
    Weights(WeightsConfig),
}

/// A primitive whose weights come from the input `weights`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WeightsConfig {
    /// Number of kernels for each dimension, 2 to 1000: straight until weights come. Default 30. This or
    /// `file`.
    pub kernels: Option<usize>,
    /// The primitive until weights come: a file that `motorium primitive fit` wrote, relative to the graph
    /// file.
    #[schemars(extend("format" = "path"))]
    pub file: Option<String>,
}

/// A recorded movement of the end effector, to be learned and reproduced.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DemonstrationConfig {
    /// The recording, relative to the graph file: CSV, JSON or JSON lines, such as `motorium topic echo
    /// --json` prints. Three channels are positions of the end effector in the world frame, m; as many as the
    /// robot has joints are joint positions.
    #[schemars(extend("format" = "path"))]
    pub file: String,
    /// Number of kernels for each dimension. Default 40.
    #[serde(default = "forty")]
    pub kernels: usize,
    /// Frequency above which the recording is noise, Hz. Default 10.
    #[serde(default = "ten")]
    pub cutoff: f64,
    /// Time of a straight way to where the recording begins, such as "2 s". Without it, the movement begins
    /// where the hand is.
    #[serde(default)]
    pub approach: Option<TimeSpan>,
}

fn forty() -> usize {
    40
}

fn ten() -> f64 {
    10.0
}

/// Slow-down of the movement while the end effector cannot follow.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseStopConfig {
    /// Distance of the end effector from its target at which the movement goes at half its speed, m.
    pub distance: f64,
}

/// Points that the movement steers round.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstaclesConfig {
    /// The points, in the world frame, m.
    pub points: Vec<[f64; 3]>,
    /// Strength, 1/s per rad. Default 1000.
    #[serde(default = "strength")]
    pub gamma: f64,
    /// Rate at which the effect fades with the angle between the velocity and the obstacle, 1/rad. Default
    /// 6.37.
    #[serde(default = "fading")]
    pub beta: f64,
    /// Distance at which the effect has fallen to 1/e, m. Default 0.2.
    #[serde(default = "near")]
    pub reach: f64,
}

/// Giving way to a force, as a mass would.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingConfig {
    /// The mass, kg.
    pub inertia: f64,
    /// Force along an axis that does not count, such as the noise of the sensor, N. Default 0.
    #[serde(default)]
    pub deadband: f64,
}

fn strength() -> f64 {
    ObstacleAvoidance::default().gamma
}

fn fading() -> f64 {
    ObstacleAvoidance::default().beta
}

fn near() -> f64 {
    0.2
}
