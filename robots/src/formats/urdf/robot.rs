//! The robot of a URDF file.

use super::ModelWarning;
use crate::Model;

/// A robot read from a URDF text.
#[derive(Clone, Debug)]
pub struct UrdfRobot {
    /// The robot.
    pub model: Model,
    /// Defects that did not prevent loading.
    pub warnings: Vec<ModelWarning>,
}
