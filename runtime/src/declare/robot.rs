//! Robot references: names, and the location of their models.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Pose of a robot's base in the world, as in the graph file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BasePose {
    /// Position of its origin, m.
    #[serde(default)]
    pub position: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes x, y, z, in this order, rad.
    #[serde(default)]
    pub rpy: [f64; 3],
}

/// A component's robot: its name, the location of its model, and its pose.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotReference {
    /// Name in the graph file.
    pub name: String,
    /// The value of `urdf` or `mjcf` in the graph file: a catalogue name, a folder or a file.
    pub urdf: String,
    /// Folder that relative paths refer to, which is the folder of the graph file.
    pub base: PathBuf,
    /// Pose of its base in the world; `None` if missing from the graph file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<BasePose>,
    /// File of its profile; `None` if not named in the graph file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<PathBuf>,
    /// Folders searched first for the packages of its files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub package_path: Vec<PathBuf>,
    /// The keys `joints`, `fixed`, `frame`, `start` and `gains` of the graph file, and `mjcf = true` if the
    /// model is given by that key, as a table; `None` without any of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings: Option<serde_json::Value>,
}
