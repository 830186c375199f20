//! Outcome of a fault: behaviour of the robot and recovery of the process.

use core::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Behaviour of the robot after a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Robot {
    /// The robot follows its commands without interruption.
    GoesOn,
    /// The actuators enter their safe state. If the run continues, they then follow commands again.
    Safe,
    /// The victim is the robot's only actuator. No command is applied until the actuator runs again.
    WithoutActuator,
}

/// State of the victim, or of the run, after a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum After {
    /// The victim continues, or the run does not need it.
    GoesOn,
    /// A new process has replaced the victim.
    Replaced,
    /// The run has ended.
    RunEnds,
}

/// The outcome of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Outcome {
    /// Behaviour of the robot after the fault.
    pub robot: Robot,
    /// State of the victim, or of the run, after the fault.
    pub after: After,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.robot {
            Robot::GoesOn => "continues",
            Robot::Safe => "safe state",
            Robot::WithoutActuator => "no actuator",
        })?;
        f.write_str(match self.after {
            After::GoesOn => "",
            After::Replaced => "; new process",
            After::RunEnds => "; run ends",
        })
    }
}
