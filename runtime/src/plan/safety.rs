//! Safety of a plan: safe state, ages, limits and recovery.

use serde::{Deserialize, Serialize};

/// State that an actuator applies when commands are stale or invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SafeState {
    /// Hold the position that the joint had when its command became stale, with at least the profile's gains.
    Hold,
    /// Damp the motion, without a position setpoint.
    Damp,
    /// Apply no effort at all.
    ZeroTorque,
    /// Stop as fast as the effort limits allow, then hold the position.
    Brake,
}

/// Policy for a command that exceeds a limit of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LimitPolicy {
    /// Apply the command as far as the limits allow.
    Clamp,
    /// Refuse the command, and apply the safe state.
    Refuse,
}

/// Recovery from the safe state once commands are fresh again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResumeRule {
    /// Move from the held pose towards the commanded setpoints, initially at half of the velocity and
    /// acceleration limits and later faster, then apply the commands. If the setpoints are within reach,
    /// apply the commands immediately.
    Near,
    /// Stay in the safe state until the user runs `motorium resume`, then continue as for `near`.
    Latch,
    /// Apply the commands immediately, at any distance between the held pose and the commanded setpoints.
    AtOnce,
}

/// Name of the input by which an actuator's gate reads the emergency-stop topic.
pub(crate) const EMERGENCY_STOP_PORT: &str = "emergency_stop";

/// Rules by which a command gate checks commands and applies the safe state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GateRules {
    /// Safe state, applied in place of commands.
    pub safe_state: SafeState,
    /// Policy for commands that exceed a limit.
    pub limits: LimitPolicy,
    /// Recovery from the safe state.
    pub resume: ResumeRule,
}

/// Limits and states for the safety of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SafetyPlan {
    /// Maximum age of a command since its publication, ns. Older commands are never applied.
    pub stale_after_ns: u64,
    /// Maximum age of the measurement from which a command was computed, ns. Commands from older measurements
    /// are never applied.
    pub source_stale_after_ns: u64,
    /// Rules of the gates of all actuators.
    #[serde(flatten)]
    pub gate: GateRules,
    /// Time for which actuators stay in the safe state before they are stopped, at every end of a run, ns.
    pub settle_ns: u64,
    /// Maximum age of the newest value of the emergency-stop topic, ns; 0 disables the limit.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub emergency_stop_max_age_ns: u64,
    /// If true, an invalid command for one robot puts all robots of the same actuator into their safe state.
    /// If false, each robot enters its safe state independently.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub stop_together: bool,
}

/// Safety rules of one actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorSafety {
    /// Maximum age of a command since its publication, ns. Older commands are never applied.
    pub stale_after_ns: u64,
    /// Maximum age of the measurement from which a command was computed, ns. Commands from older measurements
    /// are never applied.
    pub source_stale_after_ns: u64,
    /// Rules of the actuator's gates.
    #[serde(flatten)]
    pub gate: GateRules,
    /// Time for which the actuator stays in the safe state before it ends, if it must end without the
    /// launcher, ns.
    pub settle_ns: u64,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl SafetyPlan {
    /// Returns the safety rules of all actuators for which the graph does not override `[safety]`.
    pub(crate) fn of_actuators(&self) -> ActuatorSafety {
        ActuatorSafety {
            stale_after_ns: self.stale_after_ns,
            source_stale_after_ns: self.source_stale_after_ns,
            gate: self.gate,
            settle_ns: self.settle_ns,
        }
    }

    /// Returns the defaults of a graph, for plans that tests build.
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
