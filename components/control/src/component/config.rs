//! The `config` table of `control.qp`.

use motorium::units::TimeSpan;
use motorium_robots::PerJoint;
use motorium_worlds::World;
use schemars::JsonSchema;
use serde::Deserialize;

use super::dynamics_config::{InfeasiblePolicy, InverseDynamicsConfig};
use crate::limits::LimitsConfig;
use crate::tasks::TaskConfig;

with_defaults! {
    /// Configuration of `control.qp`. Every key has a default: for a robot of the catalogue the table may
    /// stay empty.
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
    pub struct QpControllerConfig;

    /// Tasks, at least one. Tasks on the same level are combined as a weighted sum. Default: the only end
    /// effector follows `target`, and the joints stay near the home pose.
    pub tasks: Option<Vec<TaskConfig>> = None;
    /// Settings of individual levels. Default: an empty list.
    pub levels: Vec<LevelConfig> = Vec::new();
    /// Limits of the commanded motion.
    pub limits: LimitsConfig = LimitsConfig::default();
    /// Whole-body inverse dynamics. If this table is present, the controller computes torques instead of
    /// velocities. Required for robots with a floating base.
    pub inverse_dynamics: Option<InverseDynamicsConfig> = None;
    /// Proportional gain of the joints, Nm/rad or N/m: one number, or one per joint. Default: the gains in
    /// the robot's profile.
    pub kp: Option<PerJoint> = None;
    /// Derivative gain of the joints, Nms/rad or Ns/m: one number, or one per joint. Default: the gains in
    /// the robot's profile.
    pub kd: Option<PerJoint> = None;
    /// Adds a feed-forward effort that compensates the robot's weight. Default true.
    pub gravity_compensation: bool = true;
    /// Adds a feed-forward effort for the acceleration of the setpoint. Default false.
    pub inertia_compensation: bool = false;
    /// Gravity in the world frame, m/s^2. Default [0, 0, -9.81].
    pub gravity: [f64; 3] = [0.0, 0.0, -9.81];
    /// World with the ground and the objects that `limits.collision` uses. Only for a graph without a
    /// `[world]`.
    pub world: World = World::default();
    /// Source of the joint positions at which the tasks are evaluated. Default "measured".
    pub feedback: Feedback = Feedback::Measured;
    /// Maximum distance of the position setpoint from the measured position, rad or m. A blocked joint is
    /// pushed with at most `kp` times this distance. Default 0.1.
    pub max_lead: f64 = 0.1;
    /// Tikhonov regularisation of the joint velocity, 1/(rad/s)^2, 1e-12 to 1, for all levels without an
    /// entry in `levels`. Default 1e-7.
    pub damping: f64 = 1e-7;
    /// Maximum age of the joint state. When it is older, the controller publishes no command, and the drives
    /// enter their safe state. Default 10 ms.
    pub state_timeout: TimeSpan = TimeSpan { ns: 10_000_000 };
    /// Age beyond which a target is treated as stationary. Default 50 ms.
    pub target_timeout: TimeSpan = TimeSpan { ns: 50_000_000 };
    /// Duration of the linear ramp after a change of a gain or weight. A task is faded in if its weight
    /// becomes nonzero, and faded out if it becomes 0. Default 200 ms; 0 applies changes immediately.
    pub task_ramp: TimeSpan = TimeSpan { ns: 200_000_000 };
    /// Policy for contradictory constraints. Used only without `inverse_dynamics`, which has its own key
    /// `on_infeasible`. Default "hold".
    pub on_infeasible: Option<InfeasiblePolicy> = None;
}

impl QpControllerConfig {
    /// Policy for contradictory constraints.
    pub(super) fn policy(&self) -> InfeasiblePolicy {
        match &self.inverse_dynamics {
            Some(table) => table.on_infeasible,
            None => self.on_infeasible.unwrap_or(InfeasiblePolicy::Hold),
        }
    }
}

/// Settings of one priority level.
///
/// ```toml
/// levels = [{ level = 2, damping = 1e-4 }]
/// ```
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LevelConfig {
    /// Number of the level. At least one task must be on it.
    pub level: u32,
    /// Tikhonov regularisation of this level, 1e-12 to 1, which replaces `damping`: cost of joint velocities,
    /// 1/(rad/s)^2, or with `inverse_dynamics` of accelerations and contact forces. The regularisation
    /// smooths this level and does not restrict the levels below.
    pub damping: f64,
}

/// Source of the joint positions at which the tasks are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// Measured positions and velocities; drive errors are corrected.
    Measured,
    /// Commanded positions and velocities: free of sensor noise, but drive errors remain.
    Setpoint,
}
