//! The `config` table of `policy.joint_targets`.

use motorium::units::TimeSpan;
use motorium_models::policy::Action;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::joint_command::earth;
use crate::motion_limits::MotionLimitsConfig;
use crate::text_or_table::text_or_table;

/// Configuration of `policy.joint_targets`.
///
/// ```toml
/// [policy]
/// rate = 50.0
/// action = { joints = ["panda_joint1", "panda_joint2"], scale = 0.5, default_pose = [0.0, -0.8] }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointTargetsConfig {
    /// Path of the policy's folder, which contains `policy.toml`, relative to the graph file; or a table with
    /// the rate and the action.
    pub policy: PolicySource,
    /// Maximum age of an action. Must be at least one period of the policy. Default: 1.5 periods.
    #[serde(default)]
    pub hold: Option<TimeSpan>,
    /// Behaviour without a fresh action. Default: "default_pose" for position actions, "hold" for chunks,
    /// otherwise "stop".
    #[serde(default)]
    pub when_stale: Option<WhenStale>,
    /// Duration of the transitions from the current joint positions to the first action, to the default pose,
    /// and back. Default "500 ms".
    #[serde(default = "half_second")]
    pub ease: TimeSpan,
    /// `true` interpolates linearly between actions, which delays them by one period of the policy. Default
    /// false: the latest action is held.
    #[serde(default)]
    pub interpolate: bool,
    /// Limits within which setpoints follow the actions. Default: no limits for actions, the robot's limits
    /// for chunks.
    #[serde(default)]
    pub limits: Option<MotionLimitsConfig>,
    /// Transition from one chunk to the next, for policies that publish chunks of several future actions.
    #[serde(default)]
    pub chunks: Option<ChunksConfig>,
    /// Adds the effort that compensates gravity. Default false.
    #[serde(default)]
    pub gravity_compensation: bool,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
}

/// Source of the rate and the definition of actions.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum PolicySource {
    /// Path of the policy's folder, relative to the graph file.
    Folder(#[schemars(extend("format" = "path"))] String),
    /// A table with the rate and the action.
    Table(Box<ActionTable>),
}

impl<'de> Deserialize<'de> for PolicySource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer, "the folder of a policy, or a table", Self::Folder, |table| {
            Self::Table(Box::new(table))
        })
    }
}

/// Rate and definition of the actions that a policy in another program publishes.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ActionTable {
    /// Rate of the actions, Hz, above 0.
    pub rate: f64,
    /// Definition of the actions.
    pub action: Action,
}

/// Behaviour without a fresh action.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenStale {
    /// Moves the joints to the default pose and holds it. Only for position actions.
    DefaultPose,
    /// Holds the last target. Only for position actions.
    Hold,
    /// Stops publishing commands, so that the robot enters its safe state.
    Stop,
}

/// Transition from one chunk to the next. A chunk contains several future actions.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ChunksConfig {
    /// Time for which the previous chunk remains in effect after a new one arrives. Default 0.
    pub frozen: TimeSpan,
    /// Duration of the blend into the new chunk, which starts after the time `frozen`. Default "100 ms".
    pub blend: TimeSpan,
}

impl Default for ChunksConfig {
    fn default() -> Self {
        Self { frozen: TimeSpan { ns: 0 }, blend: TimeSpan { ns: 100_000_000 } }
    }
}

fn half_second() -> TimeSpan {
    TimeSpan { ns: 500_000_000 }
}
