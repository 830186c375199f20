//! Outcome of a fault: behaviour of the robot and recovery of the process.

use core::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The robot after a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Robot {
    /// It follows its commands without interruption.
    GoesOn,
    /// Its actuators enter their safe state, and follow commands again if the run continues.
    Safe,
    /// Its only actuator is the victim: nothing is applied until it is back.
    WithoutActuator,
}

/// The process that was hit, or the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum After {
    /// The process continues, or is not needed.
    GoesOn,
    /// A new process has replaced it.
    Replaced,
    /// The run has ended.
    RunEnds,
}

/// The outcome of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Outcome {
    /// The robot.
    pub robot: Robot,
    /// The process that was hit, or the run.
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
