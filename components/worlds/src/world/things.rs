//! The ground and the objects of a world, with their surfaces.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::stated_mass;
use super::{ObjectMass, ObjectShape};
use crate::{FrictionCombine, Grain, Softness};

/// A horizontal plane, solid below.
///
/// The following ground is a treadmill that runs backwards under a robot:
///
/// ```
/// use motorium_worlds::World;
///
/// let world: World = toml::from_str("ground = { conveyor = { velocity = [-0.5, 0.0, 0.0] } }").unwrap();
/// assert_eq!(world.ground.unwrap().conveyor.unwrap().velocity[0], -0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Height of the plane (m).
    pub height: f64,
    /// Coefficient of friction, default 0.8. A surface with friction 0 is frictionless against every surface
    /// without a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Rule by which the friction coefficients of two surfaces combine. Default: the mean if the friction is
    /// above 0, otherwise the product.
    pub friction_combine: Option<FrictionCombine>,
    /// Coefficient of torsional friction (m): maximum torque about the contact normal per normal force. A
    /// contact uses the mean value of both surfaces. Default 0.
    #[schemars(range(min = 0.0))]
    pub torsional_friction: f64,
    /// Coefficient of rolling friction (m): maximum torque against rolling per normal force. A contact uses
    /// the mean value of both surfaces. Default 0.
    #[schemars(range(min = 0.0))]
    pub rolling_friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. A contact uses the mean value of
    /// both surfaces. Default 0.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// Tangential motion of the surface, as on a treadmill. Default: at rest.
    pub conveyor: Option<Conveyor>,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    pub soft: Option<Softness>,
    /// Direction-dependent friction. Default: the same in all directions.
    pub grain: Option<Grain>,
}

impl Default for Ground {
    /// A level plane at z = 0 at rest, with a friction of 0.8.
    fn default() -> Self {
        Self {
            height: 0.0,
            friction: DEFAULT_FRICTION,
            friction_combine: None,
            torsional_friction: 0.0,
            rolling_friction: 0.0,
            restitution: 0.0,
            conveyor: None,
            soft: None,
            grain: None,
        }
    }
}

/// A surface that moves tangentially while its body stays in place, like a conveyor belt.
///
/// Friction accelerates objects until they move with the surface. The speed of the surface does not depend on
/// the load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Conveyor {
    /// Velocity of the surface relative to its body (m/s), in the axes of the object; for the ground, in
    /// world axes. At a contact, only the tangential component acts.
    pub velocity: [f64; 3],
}

/// An object of a world, fixed or free to move.
///
/// ```
/// use motorium_worlds::{Object, ObjectShape};
///
/// let ball = Object {
///     name: "ball".to_owned(),
///     shape: ObjectShape::Sphere { radius: 0.03 },
///     mass: Some(0.05),
///     rolling_friction: 1e-3,
///     ..Object::default()
/// };
/// assert!(ball.is_dynamic());
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Name, unique in the world; not `ground`, `terrain` or the name of a robot link.
    pub name: String,
    /// Shape of uniform density, centred on the object's origin. A mesh keeps the origin of its file; a
    /// compound keeps the common origin of its parts.
    pub shape: ObjectShape,
    /// Mass (kg). An object with neither a mass nor a density is fixed.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass: Option<f64>,
    /// Density (kg/m3), from which the mass is computed. Excludes `mass`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub density: Option<f64>,
    /// Position of the object's origin (m).
    pub position: [f64; 3],
    /// Orientation: roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Initial velocity of the object's centre of mass, world axes (m/s). Default: at rest.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Initial angular velocity, world axes (rad/s).
    #[serde(default)]
    pub angular_velocity: [f64; 3],
    /// Coefficient of friction, default 0.8. A surface with friction 0 is frictionless against every surface
    /// without a `friction_combine`.
    #[serde(default = "default_friction")]
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Rule by which the friction coefficients of two surfaces combine. Default: the mean if the friction is
    /// above 0, otherwise the product.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_combine: Option<FrictionCombine>,
    /// Coefficient of torsional friction (m): maximum torque about the contact normal per normal force. A
    /// contact uses the mean value of both surfaces. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub torsional_friction: f64,
    /// Coefficient of rolling friction (m): maximum torque against rolling per normal force. A contact uses
    /// the mean value of both surfaces. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub rolling_friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. A contact uses the mean value of
    /// both surfaces. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// Tangential motion of the surface, as on a conveyor belt. Default: at rest.
    #[serde(default)]
    pub conveyor: Option<Conveyor>,
    /// Drag area: drag coefficient times frontal area (m2). The drag force acts at the object's centre and
    /// equals half the air density times this area times the square of the relative air velocity. Default 0:
    /// no drag.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub drag: f64,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    #[serde(default)]
    pub soft: Option<Softness>,
    /// Direction-dependent friction. Default: the same in all directions.
    #[serde(default)]
    pub grain: Option<Grain>,
    /// Copies in a regular pattern, called `NAME_0`, `NAME_1` and so on. After parsing, each copy is a
    /// separate object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copies: Option<Copies>,
}

/// Copies of an object in rows, columns and layers along the object's own axes.
///
/// ```
/// use motorium_worlds::World;
///
/// let text = r#"
/// [[objects]]
/// name     = "crate"
/// shape    = { box = { size = [0.4, 0.4, 0.4] } }
/// position = [2.0, 0.0, 0.2]
/// copies   = { count = [3, 1, 2], spacing = [1.0, 0.0, 0.4] }
/// "#;
/// let world: World = toml::from_str(text).unwrap();
/// let names: Vec<&str> = world.objects.iter().map(|object| object.name.as_str()).collect();
/// assert_eq!(names, ["crate_0", "crate_1", "crate_2", "crate_3", "crate_4", "crate_5"]);
/// assert_eq!(world.objects[5].position, [4.0, 0.0, 0.6000000000000001]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Copies {
    /// Number of copies along x, y and z of the object, including the original: 1 to 1000 each, at most 1000
    /// in total.
    #[schemars(inner(range(min = 1, max = 1000)))]
    pub count: [usize; 3],
    /// Distance between consecutive copies along x, y and z (m).
    pub spacing: [f64; 3],
}

/// Default coefficient of friction.
const DEFAULT_FRICTION: f64 = 0.8;

fn default_friction() -> f64 {
    DEFAULT_FRICTION
}

impl Default for Object {
    /// A fixed cube with sides of 0.1 m about the origin, called `object`.
    fn default() -> Self {
        Self {
            name: "object".to_owned(),
            shape: ObjectShape::Box { size: [0.1; 3] },
            mass: None,
            density: None,
            position: [0.0; 3],
            rpy: [0.0; 3],
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            friction: DEFAULT_FRICTION,
            friction_combine: None,
            torsional_friction: 0.0,
            rolling_friction: 0.0,
            restitution: 0.0,
            conveyor: None,
            drag: 0.0,
            soft: None,
            grain: None,
            copies: None,
        }
    }
}

impl Object {
    /// Returns the initial pose of the object.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy;
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }

    /// Returns `true` if the object has a mass or density and therefore moves.
    pub fn is_dynamic(&self) -> bool {
        let of_parts = || match &self.shape {
            ObjectShape::Compound(parts) => stated_mass(parts).is_some(),
            _ => false,
        };
        self.mass.is_some() || self.density.is_some() || of_parts()
    }

    /// Returns the mass and inertia of a moving object; `None` for a fixed object or an unreadable mesh.
    ///
    /// ```
    /// use motorium_worlds::{Object, ObjectShape};
    ///
    /// let shape = ObjectShape::Box { size: [0.1; 3] };
    /// let cube = Object { shape, density: Some(1000.0), ..Object::default() };
    /// assert!((cube.mass_properties().unwrap().mass - 1.0).abs() < 1e-12);
    /// ```
    pub fn mass_properties(&self) -> Option<ObjectMass> {
        let of_volume = || Some(self.density? * self.shape.volume()?);
        let of_parts = || match &self.shape {
            ObjectShape::Compound(parts) => stated_mass(parts),
            _ => None,
        };
        self.shape.mass_properties(self.mass.or_else(of_volume).or_else(of_parts)?)
    }
}
