//! The component kinds this program hosts, and the robots it knows.

use std::path::Path;

use motorium::declare::ConfigError;
use motorium::worker::{Kind, Registry, RobotSource};

/// Everything built in.
pub(crate) fn registry() -> Registry {
    Registry::new(
        RobotSource { check: check_robot },
        [
            Kind::of::<motorium_physics::RapierPhysics>(),
            Kind::of::<motorium_sensors::JointEncoder>(),
            Kind::of::<motorium_control::QpController>(),
            Kind::of::<motorium_policies::CpgPolicy>(),
            Kind::of::<motorium_policies::DmpPolicy>(),
            Kind::of::<motorium_policies::ProMpPolicy>(),
            Kind::of::<motorium_policies::LibraryPolicy>(),
            Kind::of::<motorium_interfaces::ConsoleLog>(),
            Kind::of::<motorium_benches::relay::Relay>(),
        ],
    )
}

fn check_robot(urdf: &str, base: &Path) -> Result<Vec<String>, ConfigError> {
    let loaded = motorium_robots::load(urdf, base).map_err(|error| ConfigError::new(error.to_string()))?;
    Ok(loaded.warnings.iter().map(ToString::to_string).collect())
}
