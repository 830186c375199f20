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
    /// Folder of the policy, with `policy.toml`, relative to the graph file; or a table with the rate and the
    /// action.
    pub policy: PolicySource,
    /// Maximum age of an action; at least a period of the policy. Default: 1.5 periods of the policy.
    #[serde(default)]
    pub hold: Option<TimeSpan>,
    /// Behaviour without a fresh action. Default: "default_pose" for actions that are positions, "hold" for
    /// chunks, otherwise "stop".
    #[serde(default)]
    pub when_stale: Option<WhenStale>,
    /// Duration of the transition from the current joint positions to the first action, to the default pose,
    /// and back. Default "500 ms".
    #[serde(default = "half_second")]
    pub ease: TimeSpan,
    /// Whether to interpolate linearly between actions, which delays them by a period of the policy. Default
    /// false: the latest action is held.
    #[serde(default)]
    pub interpolate: bool,
    /// Limits within which setpoints follow the actions. Default: no limits for actions, the robot's limits
    /// for chunks.
    #[serde(default)]
    pub limits: Option<MotionLimitsConfig>,
    /// Transition between chunks, for actions that arrive in chunks.
    #[serde(default)]
    pub chunks: Option<ChunksConfig>,
    /// Whether to add the torque that compensates gravity. Default false.
    #[serde(default)]
    pub gravity_compensation: bool,
    /// Gravity in the world frame, m/s^2. Default: the graph's world, 9.81 downwards without one.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
}

/// Source of the definition of actions.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum PolicySource {
    /// The folder of a policy, relative to the graph file.
    Folder(#[schemars(extend("format" = "path"))] String),
    /// The rate and the action.
    Table(Box<ActionTable>),
}

impl<'de> Deserialize<'de> for PolicySource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer, "the folder of a policy, or a table", Self::Folder, |table| {
            Self::Table(Box::new(table))
        })
    }
}

/// The rate and the definition of actions of a policy in another program.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ActionTable {
    /// Actions per second, Hz, above 0.
    pub rate: f64,
    /// Definition of the actions.
    pub action: Action,
}

/// Behaviour without a fresh action.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenStale {
    /// Moves to the default pose and stays there; for positions.
    DefaultPose,
    /// Stays at the last target; for positions.
    Hold,
    /// Stops publishing commands, so that the robot enters its safe state.
    Stop,
}

/// The transition between chunks.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ChunksConfig {
    /// Time for which the previous chunk stays in force after a new one has arrived. Default 0.
    pub frozen: TimeSpan,
    /// Duration of the subsequent blend into the new chunk. Default "100 ms".
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
