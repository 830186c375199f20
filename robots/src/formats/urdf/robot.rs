//! The robot of a URDF file.

use super::ModelWarning;
use crate::Model;

/// A URDF text turned into a model.
#[derive(Clone, Debug)]
pub struct UrdfRobot {
    /// The robot.
    pub model: Model,
    /// Defects that did not prevent loading.
    pub warnings: Vec<ModelWarning>,
}
