//! The end of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Exit {
    /// The duration of the run was over.
    Finished,
    /// A signal requested the end.
    Interrupted,
    /// Something failed; the robot was brought to its safe state.
    SafeStop {
        /// The failure.
        reason: String,
    },
}
