//! Robot references: the names of robots and the locations of their models.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Pose of a robot's base in the world, as set in the graph file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BasePose {
    /// Position of the base frame's origin, m.
    #[serde(default)]
    pub position: [f64; 3],
    /// Roll, pitch and yaw about the fixed axes x, y and z, in this order, rad.
    #[serde(default)]
    pub rpy: [f64; 3],
}

/// The robot of a component: its name, the location of its model, and its pose.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotReference {
    /// Name of the robot in the graph file.
    pub name: String,
    /// The value of `urdf` or `mjcf` in the graph file: a catalogue name, a folder or a file.
    pub urdf: String,
    /// Folder of the graph file, which relative paths refer to.
    pub base: PathBuf,
    /// Pose of the robot's base in the world; `None` if the graph file does not set it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<BasePose>,
    /// File of the robot's profile (home pose, gains and frames); `None` if the graph file does not name a
    /// file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<PathBuf>,
    /// Folders that are searched for the packages of the model's files, before the folders in
    /// `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub package_path: Vec<PathBuf>,
    /// Table of the keys `joints`, `fixed`, `frame`, `start` and `gains` of the robot in the graph file, with
    /// `mjcf = true` if the graph file names the model by `mjcf`. `None` if none of these keys is set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settings: Option<serde_json::Value>,
}
