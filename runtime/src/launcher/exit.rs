//! The end of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The end of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Exit {
    /// Its duration was over.
    Finished,
    /// A signal requested the end.
    Interrupted,
    /// Something failed; the robot was brought to its safe state.
    SafeStop {
        /// The failure.
        reason: String,
    },
}
