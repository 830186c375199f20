//! The `config` table of `physics.rapier`.

use motorium::component::ConfigError;
use motorium_robots::Loaded;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::{BuildError, Options, World};

/// Configuration of a simulated robot.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RapierConfig {
    /// Named pose of the robot's profile to start in. Without it and `position`: the home pose, or, for a robot without
    /// a profile, all joints at zero (at the middle of their range where zero is outside).
    pub pose: Option<String>,
    /// Joint positions to start at, in the order of the robot's joints (rad or m). Instead of `pose`.
    pub position: Option<Vec<f64>>,
    /// What surrounds the robot.
    pub world: World,
    /// Settings of the engine.
    pub solver: Options,
}

impl RapierConfig {
    /// Where the robot starts.
    pub(super) fn start(&self, robot: &Loaded) -> Result<Vec<f64>, ConfigError> {
        let model = &robot.model;
        let named = |error: motorium_robots::ProfileError| ConfigError::key("pose", error.to_string());
        match (&self.pose, &self.position, &robot.profile) {
            (Some(_), Some(_), _) => {
                Err(ConfigError::new("both `pose` and `position` say where the robot starts")
                    .advise("keep one of them"))
            }
            (None, Some(position), _) if position.len() != model.nv() => {
                let names = model.joint_names().join(", ");
                let message = format!("{} positions, expected {}: {names}", position.len(), model.nv());
                Err(ConfigError::key("position", message))
            }
            (None, Some(position), _) => Ok(position.clone()),
            (Some(pose), None, None) => {
                let message = format!("pose \"{pose}\" of a robot without a profile");
                Err(ConfigError::key("pose", message)
                    .advise("write its `position` instead, or a profile (.toml) beside its URDF"))
            }
            (Some(pose), None, Some(profile)) => {
                Ok(profile.pose(model, pose).map_err(named)?.as_slice().to_vec())
            }
            (None, None, Some(profile)) => Ok(profile.home(model).map_err(named)?.as_slice().to_vec()),
            (None, None, None) => Ok(model
                .lower()
                .iter()
                .zip(model.upper().iter())
                .map(|(low, high)| rest_position(*low, *high))
                .collect()),
        }
    }
}

/// Zero, or where the range excludes it, its middle (its end, if it is open).
fn rest_position(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    if low > 0.0 || high < 0.0 {
        if middle.is_finite() { middle } else { 0.0_f64.max(low).min(high) }
    } else {
        0.0
    }
}

/// Which key is to blame.
pub(super) fn refused(error: BuildError) -> ConfigError {
    let message = error.to_string();
    match error {
        BuildError::World(_) => ConfigError::key("world", message),
        BuildError::Option { name, .. } => ConfigError::key(format!("solver.{name}"), message),
        BuildError::State(_) => ConfigError::key("position", message),
    }
}
