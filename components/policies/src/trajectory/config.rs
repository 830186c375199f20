//! The `config` tables of `policy.trajectory` and `policy.home`.

use motorium::declare::Declare;
use motorium::units::TimeSpan;
use motorium_primitives::profile::Shape;
use motorium_primitives::reach::Repeat;
use motorium_robots::PerJoint;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::gripper::Gripper;
use crate::joint_command::earth;
use crate::motion_limits::MotionLimitsConfig;
use crate::robot::warn_of_angles;
use crate::text_or_table::text_or_table;

/// Configuration of `policy.trajectory`.
///
/// ```toml
/// repeat = "forever"
/// goals  = [
///     { position = [0.5, -0.6, 0.0, -2.0, 0.0, 1.6, 0.8, 0.02], dwell = "500 ms" },
///     { offset = { panda_joint1 = -1.0 }, duration = "3 s" },
///     { end_effector = { position = [0.4, 0.1, 0.3], rpy = [3.1416, 0.0, 0.0] }, gripper = "open" },
///     { gripper = "close", duration = "300 ms" },
///     "ready",
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryConfig {
    /// The goals in order: tables, or names of poses of the robot's profile ("home" is its home pose).
    pub goals: Vec<JointGoal>,
    /// Behaviour after the last goal: "once" stays there, "forever" returns to the first.
    #[serde(default)]
    pub repeat: Repeat,
    /// Frame to which end effector poses refer. Default: the frame of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// "time_optimal" (default): as fast as the limits allow. "minimum_jerk": with the least jerk.
    #[serde(default)]
    pub profile: Shape,
    /// Limits of the motion.
    #[serde(default)]
    pub limits: MotionLimitsConfig,
    /// Largest distance of a measured joint from a goal at which the goal counts as reached, rad or m.
    /// Default 0.01.
    #[serde(default = "hundredth")]
    pub tolerance: f64,
    /// Gravity in the world frame, m/s^2. Default: the gravity of the graph's world, 9.81 downwards without
    /// one.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Gains of the joints and feed-forward of the commands.
    #[serde(default)]
    pub joint_command: JointDriveConfig,
}

/// Configuration of `policy.home`: `policy.trajectory` with one goal.
///
/// ```toml
/// pose = "ready"
/// limits = { fraction = 0.2 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HomeConfig {
    /// Target pose from the robot's profile. Default: its home pose.
    pub pose: String,
    /// "time_optimal" (default): as fast as the limits allow. "minimum_jerk": with the least jerk.
    pub profile: Shape,
    /// Limits of the motion.
    pub limits: MotionLimitsConfig,
    /// Largest distance of a measured joint from the pose at which it counts as reached, rad or m. Default
    /// 0.01.
    pub tolerance: f64,
    /// Gravity in the world frame, m/s^2. Default: the gravity of the graph's world, 9.81 downwards without
    /// one.
    pub gravity: [f64; 3],
    /// Gains of the joints and feed-forward of the commands.
    pub joint_command: JointDriveConfig,
}

impl Default for HomeConfig {
    fn default() -> Self {
        Self {
            pose: HOME.to_string(),
            profile: Shape::default(),
            limits: MotionLimitsConfig::default(),
            tolerance: hundredth(),
            gravity: earth(),
            joint_command: JointDriveConfig::default(),
        }
    }
}

impl TrajectoryConfig {
    /// Warns of orientations that were probably written in degrees.
    pub(super) fn warn_of_angles(&self, declare: &mut Declare) {
        for (index, goal) in self.goals.iter().enumerate() {
            if let JointGoal::Table(JointGoalConfig { end_effector: Some(pose), .. }) = goal {
                let key = format!("goals[{index}].end_effector.rpy");
                warn_of_angles(&key, pose.rpy.as_slice().as_flattened(), declare);
            }
        }
    }
}

impl From<HomeConfig> for TrajectoryConfig {
    fn from(home: HomeConfig) -> Self {
        let HomeConfig { pose, profile, limits, tolerance, gravity, joint_command } = home;
        let goals = vec![JointGoal::Pose(pose)];
        let (repeat, frame) = (Repeat::Once, None);
        Self { goals, repeat, frame, profile, limits, tolerance, gravity, joint_command }
    }
}

/// Name of the home pose: the key `home` of the profile, or `start` of the graph file.
pub(super) const HOME: &str = "home";

/// A joint-space goal.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum JointGoal {
    /// The name of a pose of the robot's profile.
    Pose(String),
    /// A table.
    Table(JointGoalConfig),
}

impl<'de> Deserialize<'de> for JointGoal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer, "the name of a pose, or a table", Self::Pose, Self::Table)
    }
}

/// A joint-space goal, the duration of the movement and the time to stay. At most one of `pose`, `position`,
/// `offset` and `end_effector`; `gripper` alone, or with one of them.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointGoalConfig {
    /// Pose of the robot's profile.
    pub pose: Option<String>,
    /// Positions, rad or m: one number for all joints, a list with one for each, or a table by joint name.
    /// Joints without a number keep their position from the previous goal.
    pub position: Option<JointNumbers>,
    /// Displacements from the previous goal, or from the robot's start, rad or m; same forms as `position`.
    pub offset: Option<JointNumbers>,
    /// Pose of the end effector, which determines the joints that move it; the others keep their position
    /// from the previous goal.
    pub end_effector: Option<ToolPoseConfig>,
    /// Goal of the gripper: "open", "close", or a position of the fingers' joints, rad or m. A closed gripper
    /// may be stopped by an object, and counts as reached.
    pub gripper: Option<Gripper>,
    /// Duration of the movement; longer if the limits require it. Default: as short as the limits allow.
    pub duration: Option<TimeSpan>,
    /// Time to stay at the goal. Default 0.
    pub dwell: TimeSpan,
}

/// A pose of the end effector.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolPoseConfig {
    /// Position in the world frame, m.
    pub position: [f64; 3],
    /// Orientation in the world frame as a quaternion, x y z w. Default without `rpy`: the orientation of the
    /// previous goal.
    #[serde(default)]
    pub orientation: Option<[f64; 4]>,
    /// Orientation in the world frame as roll, pitch, yaw about the fixed axes x, y, z, in this order, rad.
    #[serde(default)]
    pub rpy: Option<[f64; 3]>,
}

/// Joint values.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected one number, a list with one number per joint, or a table by names of joints"
)]
pub enum JointNumbers {
    /// One number for all joints, or one for each.
    Each(PerJoint),
    /// Numbers by joint name.
    Named(std::collections::BTreeMap<String, f64>),
}

/// Gains of the joints and feed-forward of their commands.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointDriveConfig {
    /// Stiffness, N m/rad or N/m: one number for all joints, or one for each. Default: the stiffness of the
    /// robot's profile.
    pub kp: Option<PerJoint>,
    /// Damping, N m s/rad or N s/m: one number for all joints, or one for each. Default: the damping of the
    /// robot's profile.
    pub kd: Option<PerJoint>,
    /// Adds the effort that compensates gravity. A floating base is assumed to be upright and at rest.
    /// Default true.
    pub gravity_compensation: bool,
}

impl Default for JointDriveConfig {
    fn default() -> Self {
        Self { kp: None, kd: None, gravity_compensation: true }
    }
}

fn hundredth() -> f64 {
    0.01
}
