//! The table `limits.centre_of_mass_velocity` of `control.qp`: the centre of mass stays within largest
//! speeds.

use motorium::prelude::*;
use motorium_robots::Model;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::checks::in_range;
use crate::limits::CentreOfMassVelocityLimit;

/// Largest speeds of the centre of mass along the axes of the world, in all levels.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CentreOfMassLimitConfig {
    /// Largest speed along x, m/s, at least 0. Default: no limit.
    pub x: Option<f64>,
    /// Largest speed along y, m/s, at least 0. Default: no limit.
    pub y: Option<f64>,
    /// Largest speed along z, m/s, at least 0. Default: no limit.
    pub z: Option<f64>,
}

impl CentreOfMassLimitConfig {
    /// The limit, checked.
    pub(super) fn build(&self, model: &Model) -> Result<CentreOfMassVelocityLimit, ConfigError> {
        let key = "limits.centre_of_mass_velocity";
        let axis = |name: &str, speed: Option<f64>| {
            speed.map_or(Ok(f64::INFINITY), |speed| in_range(&format!("{key}.{name}"), speed, 0.0..=f64::MAX))
        };
        let most = Vector3::new(axis("x", self.x)?, axis("y", self.y)?, axis("z", self.z)?);
        if most.iter().all(|speed| speed.is_infinite()) {
            return Err(ConfigError::key(key, "it limits nothing")
                .advise("give the largest speed along some axis, such as `x = 0.2`"));
        }
        if model.mass() <= 0.0 {
            let message = format!("robot `{}` has no mass, so no centre of mass", model.name());
            return Err(ConfigError::key(key, message));
        }
        Ok(CentreOfMassVelocityLimit::new(model, most))
    }
}
