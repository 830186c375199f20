//! The `config` table of `policy.dmp`.

use motorium::component::TakeWeights;
use motorium::declare::Declare;
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use motorium_primitives::dmp::{ObstacleAvoidance, StoredModel};
use motorium_primitives::reach::Repeat;

use crate::gripper::Gripper;
use crate::robot::warn_of_angles;

/// Configuration of `policy.dmp`.
///
/// ```toml
/// repeat = "forever"
/// goals = [
///     { position = [0.5, 0.2, 0.3], duration = "2 s", dwell = "500 ms" },
///     { gripper = "close", dwell = "200 ms" },
///     { offset = [0.0, -0.4, 0.0], rpy = [3.14, 0.0, 0.8], duration = "2 s", shape = { arc = [0.0, 0.0, 0.1] } },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DmpPolicyConfig {
    /// Goals in order.
    pub goals: Vec<GoalConfig>,
    /// Behaviour after the last goal: "once" stays at this goal, "forever" returns to the first goal.
    #[serde(default)]
    pub repeat: Repeat,
    /// Frame of the robot to control. Default: the frame of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// Start pose in the world frame. Default: the measured pose of the end effector, from the input
    /// `joint_state`.
    #[serde(default)]
    pub start: Option<PoseConfig>,
    /// Paths of primitives written by `motorium primitive fit`, relative to the graph file. Goals with the
    /// shape `"selected"` use the primitive that the parameter `primitive` selects.
    #[serde(default)]
    #[schemars(extend("format" = "path"))]
    pub primitives: Vec<String>,
    /// Time at which weights from the input `weights` take effect, for goals with the shape "weights".
    /// Default "step".
    #[serde(default)]
    pub take_weights: TakeWeights,
    /// Slow-down of the movement while the end effector cannot follow. Default: not used.
    #[serde(default)]
    pub phase_stop: Option<PhaseStopConfig>,
    /// Points that the movement avoids. Default: none.
    #[serde(default)]
    pub obstacles: Option<ObstaclesConfig>,
    /// Compliance: the force of the input `wrench` displaces the movement like a mass. Default: not used.
    #[serde(default)]
    pub yielding: Option<YieldingConfig>,
}

impl DmpPolicyConfig {
    /// Warns of orientations that were probably written in degrees.
    pub(super) fn warn_of_angles(&self, declare: &mut Declare) {
        let start = self.start.iter().map(|start| ("start.rpy".to_string(), start.rpy));
        let goals = self.goals.iter().enumerate().map(|(i, goal)| (format!("goals[{i}].rpy"), goal.rpy));
        for (key, rpy) in start.chain(goals) {
            warn_of_angles(&key, rpy.as_slice().as_flattened(), declare);
        }
    }
}

/// A pose in the world frame.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseConfig {
    /// Position, m.
    pub position: [f64; 3],
    /// Orientation as a quaternion, x y z w. Alternative to `rpy`.
    #[serde(default)]
    pub orientation: Option<[f64; 4]>,
    /// Orientation as roll, pitch, yaw about the fixed axes x, y, z, in this order, rad. Alternative to
    /// `orientation`.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
}

/// One goal and the movement to it.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalConfig {
    /// Position in the world frame, m. Alternative to `offset`. Default: the end of a demonstration, or for a
    /// goal with a `gripper` the position of the previous goal.
    #[serde(default)]
    pub position: Option<[f64; 3]>,
    /// Position relative to the previous goal (for the first goal, relative to the start), in world axes, m.
    /// Alternative to `position`.
    #[serde(default)]
    pub offset: Option<[f64; 3]>,
    /// Orientation in the world frame as a quaternion, x y z w. Default without `rpy`: the orientation of the
    /// previous goal.
    #[serde(default)]
    pub orientation: Option<[f64; 4]>,
    /// Orientation in the world frame as roll, pitch, yaw about the fixed axes x, y, z, in this order, rad.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
    /// Goal of the gripper: "open", "close", or a position of the fingers' joints, rad or m. The goal is
    /// published on the output `fingers` when the movement starts, with the same duration. An object may stop
    /// the fingers.
    #[serde(default)]
    pub gripper: Option<Gripper>,
    /// Duration of the movement, at least 1 ms, such as "2 s". Default: the duration of a demonstration; for
    /// a gripper alone, the time that the fingers need for their whole range. Required in all other cases.
    #[serde(default)]
    pub duration: Option<TimeSpan>,
    /// Time to stay at the goal, such as "500 ms". Default 0.
    #[serde(default)]
    pub dwell: TimeSpan,
    /// Path of the position. Default: straight.
    #[serde(default)]
    pub shape: ShapeConfig,
}

/// Shape of the position path to a goal.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShapeConfig {
    /// The straight line.
    #[default]
    Straight,
    /// An arc whose midpoint deviates from the straight line by this vector, in world axes, m.
    Arc([f64; 3]),
    /// A three-dimensional primitive that was fitted to a demonstration, given in full.
    Primitive(StoredModel),
    /// A primitive from a file written by `motorium primitive fit`, relative to the graph file.
    File(#[schemars(extend("format" = "path"))] String),
    /// A primitive fitted to a recording when the component is configured.
    Demonstration(DemonstrationConfig),
    /// The primitive in `primitives` that the parameter `primitive` selects. A new selection takes effect at
    /// the next start of a movement to this goal.
    Selected,
    /// A primitive whose weights come from the input `weights`.
    Weights(WeightsConfig),
}

/// A primitive whose weights come from the input `weights`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WeightsConfig {
    /// Number of kernels for each dimension, 2 to 1000; the path is straight until weights arrive.
    /// Alternative to `file`. Default 30.
    pub kernels: Option<usize>,
    /// Path of a primitive written by `motorium primitive fit`, relative to the graph file. This primitive is
    /// used until weights arrive.
    #[schemars(extend("format" = "path"))]
    pub file: Option<String>,
}

/// A recorded movement of the end effector that is learned and reproduced.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DemonstrationConfig {
    /// Path of the recording, relative to the graph file: CSV, JSON, JSON lines (such as the output of
    /// `motorium topic echo --json`) or MCAP. Three channels are positions of the end effector in the world
    /// frame, m. Recordings with a different number of channels contain joint positions: channels named after
    /// joints, with the remaining joints at home, or one channel for each joint.
    #[schemars(extend("format" = "path"))]
    pub file: String,
    /// Number of kernels for each dimension. Default 40.
    #[serde(default = "forty")]
    pub kernels: usize,
    /// Cut-off frequency of the noise filter, Hz. Default 10.
    #[serde(default = "ten")]
    pub cutoff: f64,
    /// Duration of a straight movement to the start of the recording, such as "2 s". Default: the movement
    /// starts at the current position of the end effector.
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
    /// Distance of the end effector from its target at which the movement runs at half speed, m.
    pub distance: f64,
}

/// Points that the movement avoids.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstaclesConfig {
    /// Points in the world frame, m.
    pub points: Vec<[f64; 3]>,
    /// Strength of the avoidance, 1/s per rad. Default 1000.
    #[serde(default = "strength")]
    pub gamma: f64,
    /// Rate at which the effect decays with the angle between the velocity and the obstacle, 1/rad. Default
    /// 6.37.
    #[serde(default = "fading")]
    pub beta: f64,
    /// Distance at which the effect has fallen to 1/e, m. Default 0.2.
    #[serde(default = "near")]
    pub reach: f64,
}

/// Compliance: a measured force displaces the movement like a mass.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingConfig {
    /// Apparent mass, kg.
    pub inertia: f64,
    /// Magnitude along each axis up to which a force is ignored, for example to reject sensor noise, N.
    /// Default 0.
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
