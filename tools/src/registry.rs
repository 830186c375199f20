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
    let kinds = kinds().into_iter().chain([Kind::of::<motorium_benches::relay::Relay>()]);
    Registry::new(RobotSource { check: check_robot }, kinds)
}

fn kinds() -> Vec<Kind> {
    vec![
        Kind::of::<motorium_physics::ArticulatedPhysics>(),
        Kind::of::<motorium_physics::RapierPhysics>(),
        Kind::of::<motorium_sensors::JointEncoder>(),
        Kind::of::<motorium_sensors::JointMerge>(),
        Kind::of::<motorium_control::QpController>(),
        Kind::of::<motorium_policies::CpgPolicy>(),
        Kind::of::<motorium_policies::DmpPolicy>(),
        Kind::of::<motorium_policies::ProMpPolicy>(),
        Kind::of::<motorium_policies::LibraryPolicy>(),
        Kind::of::<motorium_bridges::Iceoryx2Bridge>(),
        Kind::of::<motorium_interfaces::ConsoleLog>(),
        Kind::of::<motorium_interfaces::UdpSensor>(),
    ]
}

fn check_robot(urdf: &str, base: &Path) -> Result<Vec<String>, ConfigError> {
    let loaded = motorium_robots::load(urdf, base).map_err(|error| ConfigError::new(error.to_string()))?;
    Ok(loaded.warnings.iter().map(ToString::to_string).collect())
}
