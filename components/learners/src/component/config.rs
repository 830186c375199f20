//! The `config` table of `learner.task`.

use motorium::units::TimeSpan;
use motorium_worlds::World;
use schemars::JsonSchema;
use serde::Deserialize;

/// Configuration of the component `learner.task`.
///
/// ```toml
/// task = "balance.toml"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearnerTaskConfig {
    /// Path of the task file, relative to the graph file.
    #[schemars(extend("format" = "path"))]
    pub task: String,
    /// Gravity, ground and objects around the robot, which are compared with the world of the task. Default:
    /// the world of the graph.
    #[serde(default)]
    pub world: World,
    /// Maximum age of a measurement, at least 1 ms. Default "100 ms".
    #[serde(default = "hundred_ms")]
    pub state_timeout: TimeSpan,
}

fn hundred_ms() -> TimeSpan {
    TimeSpan { ns: 100_000_000 }
}
