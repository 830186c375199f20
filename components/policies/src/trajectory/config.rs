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
    /// Goals in order: tables, or names of poses of the robot's profile ("home" is its home pose).
    pub goals: Vec<JointGoal>,
    /// Behaviour after the last goal: "once" stays at this goal, "forever" returns to the first goal.
    #[serde(default)]
    pub repeat: Repeat,
    /// Frame to which poses of the end effector refer. Default: the frame of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// Velocity profile: "time_optimal", as fast as the limits allow (default), or "minimum_jerk", with the
    /// least jerk.
    #[serde(default)]
    pub profile: Shape,
    /// Limits of the motion.
    #[serde(default)]
    pub limits: MotionLimitsConfig,
    /// Maximum distance of every measured joint from a goal at which the goal counts as reached, rad or m.
    /// Default 0.01.
    #[serde(default = "hundredth")]
    pub tolerance: f64,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
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
    /// Target pose from the robot's profile. Default: the home pose.
    pub pose: String,
    /// Velocity profile: "time_optimal", as fast as the limits allow (default), or "minimum_jerk", with the
    /// least jerk.
    pub profile: Shape,
    /// Limits of the motion.
    pub limits: MotionLimitsConfig,
    /// Maximum distance of every measured joint from its position in the pose at which the pose counts as
    /// reached, rad or m. Default 0.01.
    pub tolerance: f64,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
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
    /// Name of a pose of the robot's profile.
    Pose(String),
    /// A table that describes the goal.
    Table(JointGoalConfig),
}

impl<'de> Deserialize<'de> for JointGoal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer, "the name of a pose, or a table", Self::Pose, Self::Table)
    }
}

/// A joint-space goal, with the duration of the movement and the dwell time. It has at most one of `pose`,
/// `position`, `offset` and `end_effector`. A `gripper` may be given alone, or together with one of these
/// keys.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointGoalConfig {
    /// Name of a pose of the robot's profile.
    pub pose: Option<String>,
    /// Joint positions, rad or m: one number for all joints, a list with one number per joint, or a table by
    /// joint name. Joints without a number keep their position from the previous goal.
    pub position: Option<JointNumbers>,
    /// Displacements from the previous goal (for the first goal, from the robot's start), rad or m, in the
    /// same forms as `position`.
    pub offset: Option<JointNumbers>,
    /// Pose of the end effector, which determines the positions of the joints that move it. Other joints keep
    /// their position from the previous goal.
    pub end_effector: Option<ToolPoseConfig>,
    /// Goal of the gripper: "open", "close", or a position of the fingers' joints, rad or m. An object may
    /// stop a closing gripper; the goal then counts as reached.
    pub gripper: Option<Gripper>,
    /// Duration of the movement, which is extended if the limits require it. Default: the shortest duration
    /// within the limits.
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

/// Values of several joints.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected one number, a list with one number per joint, or a table by names of joints"
)]
pub enum JointNumbers {
    /// One number for all joints, or one per joint.
    Each(PerJoint),
    /// Numbers by joint name.
    Named(std::collections::BTreeMap<String, f64>),
}

/// Gains of the joints and feed-forward of their commands.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointDriveConfig {
    /// Stiffness, N m/rad or N/m: one number for all joints, or one per joint. Default: the gains of the
    /// robot's profile.
    pub kp: Option<PerJoint>,
    /// Damping, N m s/rad or N s/m: one number for all joints, or one per joint. Default: the gains of the
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
