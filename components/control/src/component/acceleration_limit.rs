//! The table `limits.acceleration` of `control.qp`: largest accelerations of the joints.

use motorium::prelude::*;
use motorium_robots::{Model, PerJoint, Profile};
use schemars::JsonSchema;
use serde::Deserialize;

use super::checks::{in_range, per_joint};
use crate::limits::{AccelerationLimit, PositionLimit};

/// Largest accelerations of the joints. They begin to brake in time for their position limits.
///
/// ```toml
/// fraction = 0.5
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AccelerationConfig {
    /// Fraction of the acceleration limits to use, above 0, at most 1. Default 1.
    pub fraction: f64,
    /// Maximum acceleration, rad/s2 or m/s2, above 0: one number, or one per joint. Default: the limits in
    /// the robot's profile; a joint without a limit is unlimited.
    pub most: Option<PerJoint>,
}

impl Default for AccelerationConfig {
    fn default() -> Self {
        Self { fraction: 1.0, most: None }
    }
}

impl AccelerationConfig {
    /// The limit, checked.
    pub(super) fn build(
        &self,
        model: &Model,
        profile: Option<&Profile>,
        position: PositionLimit,
    ) -> Result<AccelerationLimit, ConfigError> {
        let key = |name: &str| format!("limits.acceleration.{name}");
        let fraction = in_range(&key("fraction"), self.fraction, 1e-6..=1.0)?;
        let most = match (&self.most, profile) {
            (Some(given), _) => {
                let most = per_joint(&key("most"), given, model)?;
                for most in &most {
                    in_range(&key("most"), *most, 1e-6..=f64::MAX)?;
                }
                Some(most)
            }
            (None, Some(profile)) => {
                let most = profile.acceleration_limit(model);
                Some(most.map_err(|error| ConfigError::key("limits.acceleration", error.to_string()))?)
            }
            (None, None) => None,
        };
        let Some(most) = most.filter(|most| most.iter().any(|most| most.is_finite())) else {
            let message = format!("robot `{}` has no acceleration limits in its profile", model.name());
            return Err(ConfigError::key("limits.acceleration", message)
                .advise("give them here: `most`, one number or one per joint, rad/s2 or m/s2"));
        };
        Ok(AccelerationLimit::new(model, most * fraction, position))
    }
}
