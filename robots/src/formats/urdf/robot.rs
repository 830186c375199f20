//! The robot of a URDF file.

use super::ModelWarning;
use crate::Model;

/// A robot read from a URDF text.
#[derive(Clone, Debug)]
pub struct UrdfRobot {
    /// Model of the robot.
    pub model: Model,
    /// Warnings about defects that did not prevent loading.
    pub warnings: Vec<ModelWarning>,
}
