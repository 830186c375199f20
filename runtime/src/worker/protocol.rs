//! The arguments and messages between the launcher and the program of a component.

use serde::{Deserialize, Serialize};

use super::Kind;
use crate::declare::{ConfigError, Declaration, Placement, RobotReference};

/// First argument of a program that is requested to describe its component.
pub const DESCRIBE: &str = "motorium-describe";
/// First argument of a program that is requested to list the kinds of components that it hosts.
pub const KINDS: &str = "motorium-kinds";
/// First argument of a program that is requested to run its component. The folder of the run and the name of
/// the component follow.
pub const WORKER: &str = "motorium-worker";

/// First argument of a program that is requested to guard a run. The folder of the run follows.
pub const GUARD: &str = "motorium-guard";

/// First argument of a program that is requested to free the slots of a run's dead processes. The folder of
/// the run follows.
pub const CLEANER: &str = "motorium-cleaner";

/// A request to a program to describe its component, as JSON on standard input.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeRequest {
    /// Kind of the component, for a program that hosts several kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// The `config` table of the component.
    pub config: serde_json::Value,
    /// Robot named by the component's key `robot` in the graph.
    pub robot: Option<RobotReference>,
    /// Robots named by the component's key `robots` in the graph.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotReference>,
    /// Placement of the component in the graph.
    #[serde(default)]
    pub placement: Placement,
}

/// Answer to a [`DescribeRequest`], as JSON on standard output.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeAnswer {
    /// Version of motorium with which the program was built.
    pub motorium: String,
    /// Digest of the layout of shared memory, as in [`KindsAnswer`]; empty if the program was built with a
    /// version that does not report a digest.
    #[serde(default)]
    pub memory: String,
    /// Declaration of the component; `None` if the component rejected the configuration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declaration: Option<Declaration>,
    /// Error; `None` if the component accepted the configuration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<DescribeError>,
}

/// The kinds of components that a program hosts, as JSON on standard output.
#[derive(Debug, Serialize, Deserialize)]
pub struct KindsAnswer {
    /// Version of motorium with which the program was built.
    pub motorium: String,
    /// Digest of the layout of shared memory in this program.
    pub memory: String,
    /// The kinds, sorted by name.
    pub kinds: Vec<KindAnswer>,
}

/// A kind of component that a program hosts.
#[derive(Debug, Serialize, Deserialize)]
pub struct KindAnswer {
    /// Name of the kind in graph files.
    pub name: String,
    /// One-line description, which is shown in lists of kinds.
    pub summary: String,
    /// True if the kind's configuration has a key `world`, which defaults to the graph's `[world]`.
    pub reads_world: bool,
    /// True if the kind's configuration has a key `gravity`, which defaults to the gravity of the graph's
    /// `[world]`.
    pub reads_gravity: bool,
    /// JSON Schema of the kind's `config` table.
    pub schema: serde_json::Value,
    /// Definitions to which the schema refers.
    pub definitions: serde_json::Value,
}

impl KindAnswer {
    /// Creates the description of a kind.
    pub fn from_kind(kind: &Kind) -> Self {
        let (schema, definitions) = kind.config_schema();
        Self {
            name: kind.name.to_string(),
            summary: kind.summary.to_string(),
            reads_world: kind.reads_world,
            reads_gravity: kind.reads_gravity,
            schema,
            definitions,
        }
    }
}

/// An error of a component's configuration.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeError {
    /// Dotted path of the invalid key in the `config` table; `None` if the error concerns several keys.
    pub key: Option<String>,
    /// Message with the found value and the expected values.
    pub message: String,
    /// Advice in one sentence, or `None`.
    pub advice: Option<String>,
}

impl From<ConfigError> for DescribeError {
    fn from(error: ConfigError) -> Self {
        Self { key: error.key, message: error.message, advice: error.advice }
    }
}
