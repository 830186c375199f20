//! The end of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Exit {
    /// The run lasted for its duration.
    Finished,
    /// A signal requested the end of the run.
    Interrupted,
    /// A failure occurred, and the robot was brought to its safe state.
    SafeStop {
        /// Description of the failure.
        reason: String,
    },
}
