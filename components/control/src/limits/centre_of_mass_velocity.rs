//! Velocity limits of the centre of mass.

use motorium::declare::ConfigError;
use motorium_robots::Model;
use nalgebra::{Matrix3xX, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{LimitRows, RowLimit};
use crate::RobotState;
use crate::checks::in_range;

/// Keeps the velocity of the centre of mass within bounds along each axis of the world:
///
/// ```text
/// -most <= J_com v <= most                                m/s
/// ```
///
/// OpenSoT has the same constraint. An axis with an infinite bound is omitted.
#[derive(Clone, Debug)]
pub struct CentreOfMassVelocityLimit {
    most: Vector3<f64>,
    jacobian: Matrix3xX<f64>,
}

impl CentreOfMassVelocityLimit {
    /// Creates a limit for `model` with the maximum speeds along x, y and z of the world \[m/s\], at least 0.
    pub fn new(model: &Model, most: Vector3<f64>) -> Self {
        Self { most, jacobian: Matrix3xX::zeros(model.nv()) }
    }
}

impl RowLimit for CentreOfMassVelocityLimit {
    fn rows(&self) -> usize {
        3
    }

    fn write(&mut self, state: &RobotState<'_>, _: f64, rows: &mut LimitRows<'_>) {
        state.kinematics.com_jacobian(state.model, &mut self.jacobian);
        for (row, most) in self.jacobian.row_iter().zip(&self.most) {
            if most.is_finite() {
                rows.push(row.iter().copied(), -most, *most);
            }
        }
    }
}

/// Maximum speeds of the centre of mass along the axes of the world, enforced at every level.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CentreOfMassLimitConfig {
    /// Maximum speed along x, m/s, at least 0. Default: no limit.
    pub x: Option<f64>,
    /// Maximum speed along y, m/s, at least 0. Default: no limit.
    pub y: Option<f64>,
    /// Maximum speed along z, m/s, at least 0. Default: no limit.
    pub z: Option<f64>,
}

impl CentreOfMassLimitConfig {
    /// Converts and checks the limit.
    pub(crate) fn build(&self, model: &Model) -> Result<CentreOfMassVelocityLimit, ConfigError> {
        let key = "limits.centre_of_mass_velocity";
        let axis = |name: &str, speed: Option<f64>| {
            speed.map_or(Ok(f64::INFINITY), |speed| in_range(&format!("{key}.{name}"), speed, 0.0..=f64::MAX))
        };
        let most = Vector3::new(axis("x", self.x)?, axis("y", self.y)?, axis("z", self.z)?);
        if most.iter().all(|speed| speed.is_infinite()) {
            return Err(ConfigError::key(key, "the limit has no axis")
                .advise("give the largest speed along at least one axis, such as `x = 0.2`"));
        }
        if model.mass() <= 0.0 {
            let message = format!("robot `{}` has no mass and therefore no centre of mass", model.name());
            return Err(ConfigError::key(key, message));
        }
        Ok(CentreOfMassVelocityLimit::new(model, most))
    }
}
