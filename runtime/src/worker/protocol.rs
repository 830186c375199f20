//! The arguments and messages between the launcher and the program of a component.

use serde::{Deserialize, Serialize};

use super::Kind;
use crate::declare::{ConfigError, Declaration, Placement, RobotReference};

/// First argument of a program that should describe its component.
pub const DESCRIBE: &str = "motorium-describe";
/// First argument of a program that should list the kinds of components it hosts.
pub const KINDS: &str = "motorium-kinds";
/// First argument of a program that should run its component; the run's folder and the component's name
/// follow.
pub const WORKER: &str = "motorium-worker";

/// First argument of a program that should guard a run; the run's folder follows.
pub const GUARD: &str = "motorium-guard";

/// First argument of a program that should release the slots of a run's dead processes; the run's folder
/// follows.
pub const CLEANER: &str = "motorium-cleaner";

/// The request to a program to describe its component: JSON on standard input.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeRequest {
    /// The kind of the component, for a program that hosts several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// The `config` table.
    pub config: serde_json::Value,
    /// The robot that the graph assigns to the component by `robot`.
    pub robot: Option<RobotReference>,
    /// The robots that the graph assigns to the component by `robots`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotReference>,
    /// Its placement in the graph.
    #[serde(default)]
    pub placement: Placement,
}

/// The description of a component: JSON on standard output.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeAnswer {
    /// Version of motorium the program was built with.
    pub motorium: String,
    /// Digest of the layout of a run's shared memory, as in [`KindsAnswer`]; empty from builds that did not
    /// report it.
    #[serde(default)]
    pub memory: String,
    /// The declaration, unless the configuration was refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declaration: Option<Declaration>,
    /// The error, if the configuration was refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<DescribeError>,
}

/// The kinds of components that a program hosts: JSON on standard output.
#[derive(Debug, Serialize, Deserialize)]
pub struct KindsAnswer {
    /// Version of motorium the program was built with.
    pub motorium: String,
    /// Digest of the layout of a run's shared memory as the program knows it.
    pub memory: String,
    /// The kinds, sorted by name.
    pub kinds: Vec<KindAnswer>,
}

/// A kind of component that a program hosts.
#[derive(Debug, Serialize, Deserialize)]
pub struct KindAnswer {
    /// Its name in graph files.
    pub name: String,
    /// One line of explanation.
    pub summary: String,
    /// True if its configuration has a key `world`, which defaults to the graph's `[world]`.
    pub reads_world: bool,
    /// True if its configuration has a key `gravity`, which defaults to the gravity of the graph's `[world]`.
    pub reads_gravity: bool,
    /// The JSON Schema of its `config` table.
    pub schema: serde_json::Value,
    /// The definitions to which the schema refers.
    pub definitions: serde_json::Value,
}

impl KindAnswer {
    /// Describes a kind.
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

/// An error of a configuration.
#[derive(Debug, Serialize, Deserialize)]
pub struct DescribeError {
    /// The key at fault.
    pub key: Option<String>,
    /// Found value and expected values.
    pub message: String,
    /// Advice, in one sentence.
    pub advice: Option<String>,
}

impl From<ConfigError> for DescribeError {
    fn from(error: ConfigError) -> Self {
        Self { key: error.key, message: error.message, advice: error.advice }
    }
}
