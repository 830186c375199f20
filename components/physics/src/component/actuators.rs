//! The `actuator` and `actuators` tables of the physics kinds.

use std::collections::BTreeMap;
use std::path::Path;

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::{ActuatorSettings, ActuatorTable, Model};

/// Model of an actuator: the stages between the effort that a drive requests and the effort that acts on the
/// joint. This type is an [`ActuatorTable`] whose times are written as in a graph file.
pub type ActuatorConfig = ActuatorTable<TimeSpan>;

/// Returns the actuators of a model's joints: `of_all`, overridden by the settings of single joints. Empty if
/// all are ideal. Files are read from `folder`.
pub(super) fn settings(
    of_all: Option<&ActuatorConfig>,
    of_joints: &BTreeMap<String, ActuatorConfig>,
    model: &Model,
    folder: &Path,
) -> Result<Vec<Option<ActuatorSettings>>, ConfigError> {
    let settings = ActuatorTable::of_joints((of_all, of_joints), model, folder, TimeSpan::as_secs_f64);
    settings.map_err(|error| {
        let refused = ConfigError::key(error.key, error.message);
        error.advice.map_or(refused.clone(), |advice| refused.advise(advice))
    })
}
