//! Surface properties: softness, and direction-dependent friction.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{WorldError, check, from_zero, positive};

/// A compliant surface: a spring and a damper at each contact point, replacing rigid contact and restitution.
///
/// ```text
/// force = max(0, stiffness depth - damping d(distance)/dt)
/// ```
///
/// A box on four corners rests on four such springs. Between two soft surfaces, springs act in series, and so
/// do dampers.
///
/// ```
/// use motorium_robots::World;
///
/// let world: World = toml::from_str("ground = { soft = { stiffness = 2e4, damping = 50.0 } }").unwrap();
/// assert_eq!(world.ground.unwrap().soft.unwrap().stiffness, 2e4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Softness {
    /// Force per depth at a contact point (N/m), above 0.
    #[schemars(range(min = 0.0))]
    pub stiffness: f64,
    /// Force per speed of approach while the surfaces overlap (N s/m), from 0. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub damping: f64,
}

impl Softness {
    /// Checks every value of the surface of `owner`.
    ///
    /// # Errors
    ///
    /// [`WorldError::Value`].
    pub fn check(&self, owner: &str) -> Result<(), WorldError> {
        positive(owner, "soft.stiffness", self.stiffness)?;
        from_zero(owner, "soft.damping", self.damping)
    }

    /// Returns the series combination of two soft surfaces.
    pub fn behind(self, other: Self) -> Self {
        let series = |a: f64, b: f64| if a + b > 0.0 { a * b / (a + b) } else { 0.0 };
        Self {
            stiffness: series(self.stiffness, other.stiffness),
            damping: series(self.damping, other.damping),
        }
    }
}

/// Direction-dependent friction, as of a skate, a ski or corduroy: the grain's coefficient along `direction`,
/// the surface's across it.
///
/// In other directions the maximum friction forces form an ellipse, and sliding dissipates maximum energy.
///
/// ```
/// use motorium_robots::Object;
///
/// let text = r#"
/// name     = "skate"
/// shape    = { box = { size = [0.3, 0.02, 0.05] } }
/// mass     = 1.0
/// position = [0.0, 0.0, 0.025]
/// friction = 0.9
/// grain    = { direction = [1.0, 0.0, 0.0], friction = 0.02 }
/// "#;
/// let skate: Object = toml::from_str(text).unwrap();
/// assert_eq!(skate.grain.unwrap().friction, 0.02);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grain {
    /// Direction of the grain in the axes of the object, of the link, or, for the ground, of the world; of
    /// any length but 0.
    pub direction: [f64; 3],
    /// Coefficient of friction along it, at least 0. A contact uses the mean of both surfaces.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
}

impl Grain {
    /// Checks every value of the surface of `owner`.
    ///
    /// # Errors
    ///
    /// [`WorldError::Value`].
    pub fn check(&self, owner: &str) -> Result<(), WorldError> {
        let length = Vector3::from(self.direction).norm();
        let good = length.is_finite() && length > 0.0;
        check(owner, "grain.direction", length, good, "a vector of a length above 0")?;
        from_zero(owner, "grain.friction", self.friction)
    }

    /// The direction as a unit vector.
    pub fn unit(&self) -> Vector3<f64> {
        Vector3::from(self.direction).normalize()
    }
}
