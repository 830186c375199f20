//! The component kinds that this program hosts, and the robots it knows.

use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::worker::{Kind, Registry, RobotSource, Sibling};
use motorium_robots::{LoadError, ModelWarning};

/// Programs that host further kinds, separate because of their dependencies.
const SIBLINGS: &[Sibling] = &[
    VIEWER,
    Sibling { family: "bridge", program: "motorium-bridges", install: None },
    Sibling { family: "device", program: "motorium-devices", install: None },
    Sibling { family: "ros2", program: "motorium-ros2", install: None },
    Sibling { family: "zenoh", program: "motorium-zenoh", install: None },
];

/// The program of `motorium view`.
const VIEWER: Sibling = Sibling { family: "view", program: "motorium-view", install: Some(INSTALL_VIEWER) };

/// The command that installs the program of `motorium view` from a checkout.
pub(crate) const INSTALL_VIEWER: &str = "cargo install --locked --path tools/view";

/// Returns the program of `motorium view`.
pub(crate) fn viewer() -> Sibling {
    VIEWER
}

/// Returns the kinds that a graph may use.
pub(crate) fn registry() -> Registry {
    known(kinds()).with_siblings(SIBLINGS)
}

/// Returns the kinds that a graph may use, and kinds only used by the graphs of benchmarks and replays.
pub(crate) fn with_hidden() -> Registry {
    known(
        kinds()
            .into_iter()
            .chain([motorium_bridges::recording::replay_kind()])
            .chain(motorium_benches::kinds()),
    )
}

/// Creates a registry of these kinds, with the robots and the world files that the command reads.
fn known(kinds: impl IntoIterator<Item = Kind>) -> Registry {
    let gravity = |path: &Path| {
        motorium_worlds::gravity_of_file(path).map_err(|error| ConfigError::new(error.to_string()))
    };
    Registry::new(RobotSource { check: check_robot }, kinds).with_gravity_of_file(gravity)
}

fn kinds() -> Vec<Kind> {
    let mut kinds = Vec::new();
    kinds.extend(motorium_physics::kinds());
    kinds.extend(motorium_sensors::kinds());
    kinds.extend(motorium_control::kinds());
    kinds.extend(motorium_locomotion::kinds());
    kinds.extend(motorium_policies::kinds());
    kinds.extend(motorium_learners::kinds());
    kinds.extend(motorium_bridges::kinds());
    kinds.extend(motorium_can::kinds());
    kinds.extend(motorium_interfaces::kinds());
    kinds
}

fn check_robot(robot: &RobotReference) -> Result<Vec<String>, ConfigError> {
    let loaded = crate::robots::load_in_world(robot).map_err(|error| match *error.source {
        LoadError::Profile { .. } if robot.profile.is_some() => {
            ConfigError::key("profile", error.source.to_string())
                .advise("`motorium robot profile FILE` writes a valid profile")
        }
        LoadError::Read { path, source } if robot.profile.as_ref() == Some(&path) => {
            ConfigError::key("profile", format!("cannot read {}: {source}", path.display()))
                .advise("`motorium robot profile FILE --output PROFILE.toml` writes a first profile")
        }
        LoadError::Setting(error) => ConfigError::key(error.key, error.message),
        cause @ LoadError::NotMjcf(_) => ConfigError::key("mjcf", cause.to_string()),
        cause => ConfigError::new(cause.to_string()),
    })?;
    Ok(ModelWarning::summarise(&loaded.warnings))
}
