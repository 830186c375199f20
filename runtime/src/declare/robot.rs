//! Robots as the runtime knows them: names, and where their models stand.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The pose of a robot's base in the world, as the graph file has it.
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

/// The robot of a component, as the runtime knows it: its name, the place of its model, and where it stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotReference {
    /// Its name in the graph file.
    pub name: String,
    /// The value of `urdf` or `mjcf` in the graph file: a catalogue name, a folder or a file.
    pub urdf: String,
    /// Folder against which a relative path is resolved: that of the graph file.
    pub base: PathBuf,
    /// Pose of its base in the world; `None` where the graph file does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<BasePose>,
    /// The file of its profile; `None` where the graph file names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<PathBuf>,
    /// Folders in which the packages of its files are searched first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub package_path: Vec<PathBuf>,
    /// The keys `joints`, `fixed`, `frame`, `start` and `gains` of the graph file, and `mjcf` true where its model has that key, as a
    /// table; `None` where it has none of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings: Option<serde_json::Value>,
}
