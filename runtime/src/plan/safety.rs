//! Safety of a plan: safe state, ages, limits and recovery.

use serde::{Deserialize, Serialize};

/// State that an actuator applies when commands fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SafeState {
    /// Hold the position at which the command became stale, with at least the profile's gains.
    Hold,
    /// No setpoint, only damping.
    Damp,
    /// No effort at all.
    ZeroTorque,
    /// Stop as fast as the effort limits allow, then hold.
    Brake,
}

/// Policy for a command beyond a limit of its joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LimitPolicy {
    /// Apply it as far as the limits allow.
    Clamp,
    /// Do not apply it; apply the safe state instead.
    Refuse,
}

/// Recovery from the safe state once commands are fresh again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResumeRule {
    /// Follow them from the held pose, initially at half of the velocity and acceleration limits and then
    /// faster, then apply them; immediately if the setpoint is within reach.
    Near,
    /// Stay in the safe state until `motorium resume`; then like `near`.
    Latch,
    /// Apply them immediately, at any distance.
    AtOnce,
}

/// Name of the input by which an actuator's gate reads the emergency-stop topic.
pub(crate) const EMERGENCY_STOP_PORT: &str = "emergency_stop";

/// The rules by which a command gate treats the commands of its joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GateRules {
    /// State applied in place of commands.
    pub safe_state: SafeState,
    /// Policy for commands beyond a limit.
    pub limits: LimitPolicy,
    /// Recovery from the safe state.
    pub resume: ResumeRule,
}

/// Limits and states for the safety of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SafetyPlan {
    /// A command older than this is never applied.
    pub stale_after_ns: u64,
    /// A command computed from a measurement older than this is never applied.
    pub source_stale_after_ns: u64,
    /// The rules of the gates of all actuators.
    #[serde(flatten)]
    pub gate: GateRules,
    /// Time that actuators stay in the safe state before they are stopped, at every end of a run, ns.
    pub settle_ns: u64,
    /// Maximum age of the newest value of the emergency-stop topic, ns; 0 for any age.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub emergency_stop_max_age_ns: u64,
    /// If true, the failure of one robot's commands puts the other robots of its actuator into their safe
    /// state, too.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub stop_together: bool,
}

/// The safety of one actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorSafety {
    /// A command older than this is never applied, ns.
    pub stale_after_ns: u64,
    /// A command computed from a measurement older than this is never applied, ns.
    pub source_stale_after_ns: u64,
    /// The rules of its gates.
    #[serde(flatten)]
    pub gate: GateRules,
    /// Time that it stays in the safe state when it has to end without the launcher, ns.
    pub settle_ns: u64,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl SafetyPlan {
    /// Returns the safety rules of actuators that the graph does not override.
    pub(crate) fn of_actuators(&self) -> ActuatorSafety {
        ActuatorSafety {
            stale_after_ns: self.stale_after_ns,
            source_stale_after_ns: self.source_stale_after_ns,
            gate: self.gate,
            settle_ns: self.settle_ns,
        }
    }

    /// Returns the defaults of a graph, for plans that tests build by hand.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Self {
        Self {
            stale_after_ns: 5_000_000,
            source_stale_after_ns: 20_000_000,
            gate: GateRules {
                safe_state: SafeState::Hold,
                limits: LimitPolicy::Clamp,
                resume: ResumeRule::Near,
            },
            settle_ns: 0,
            emergency_stop_max_age_ns: 500_000_000,
            stop_together: false,
        }
    }
}
