//! The component kinds that this program hosts, and the robots it knows.

use std::path::Path;

use motorium::declare::ConfigError;
use motorium::worker::{Kind, Registry, RobotSource, Sibling};

/// The programs that host kinds which this one does not, because of what they depend on.
const SIBLINGS: &[Sibling] = &[
    Sibling { family: "view", program: "motorium-view", install: "cargo install motorium-view" },
    Sibling { family: "bridge", program: "motorium-bridges", install: "cargo install motorium-bridges" },
];

/// The kinds that a graph may use.
pub(crate) fn registry() -> Registry {
    Registry::new(RobotSource { check: check_robot }, kinds()).with_siblings(SIBLINGS)
}

/// The kinds that a graph may use, and those that only the graphs of benchmarks are made of.
pub(crate) fn with_benches() -> Registry {
    let kinds = kinds().into_iter().chain([motorium_benches::relay::kind()]);
    Registry::new(RobotSource { check: check_robot }, kinds)
}

fn kinds() -> Vec<Kind> {
    let mut kinds = Vec::new();
    kinds.extend(motorium_physics::kinds());
    kinds.extend(motorium_sensors::kinds());
    kinds.extend(motorium_control::kinds());
    kinds.extend(motorium_policies::kinds());
    kinds.extend(motorium_bridges::kinds());
    kinds.extend(motorium_can::kinds());
    kinds.extend(motorium_interfaces::kinds());
    kinds
}

fn check_robot(urdf: &str, base: &Path) -> Result<Vec<String>, ConfigError> {
    let loaded = motorium_robots::load(urdf, base).map_err(|error| ConfigError::new(error.to_string()))?;
    Ok(loaded.warnings.iter().map(ToString::to_string).collect())
}
