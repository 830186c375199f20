//! The things of a world: the ground and the objects, with their shapes and surfaces.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    CompoundPart, Copies, FrictionCombine, Grain, MeshShape, Softness, WorldError, compound, positive,
};
use crate::{ConvexShape, Geometry};

/// A horizontal plane, solid below.
///
/// A treadmill that runs backwards under a robot:
///
/// ```
/// use motorium_robots::World;
///
/// let world: World = toml::from_str("ground = { conveyor = { velocity = [-0.5, 0.0, 0.0] } }").unwrap();
/// assert_eq!(world.ground.unwrap().conveyor.unwrap().velocity[0], -0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Height of the plane (m).
    pub height: f64,
    /// Coefficient of friction, default 0.8; 0 is frictionless on everything without a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Rule by which frictions combine. Default: the mean of both surfaces' for a friction above 0.
    pub friction_combine: Option<FrictionCombine>,
    /// Torsional friction (m): torque about the normal per normal force; mean of both. Default 0.
    #[schemars(range(min = 0.0))]
    pub torsional_friction: f64,
    /// Coefficient of rolling friction (m): torque against rolling per normal force. A contact uses the mean
    /// of both surfaces. Default 0.
    #[schemars(range(min = 0.0))]
    pub rolling_friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. A contact uses the mean of both
    /// surfaces.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// A moving surface, as of a treadmill. Default: at rest.
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

/// A surface that moves along itself while its body stays in place, like a conveyor belt.
///
/// Objects on it experience friction until they move with it. Its speed does not depend on the load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Conveyor {
    /// Velocity of the surface relative to its body (m/s), in the axes of the object; for the ground, in
    /// world axes. At a contact the tangential component acts.
    pub velocity: [f64; 3],
}

/// An object.
///
/// ```
/// use motorium_robots::{Object, ObjectShape};
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
    /// Shape, centred on its origin, of uniform density. A mesh keeps the origin of its file, a compound the
    /// origin of its parts.
    pub shape: ObjectShape,
    /// Mass (kg). Without it, and without a density, the object is fixed.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass: Option<f64>,
    /// Density (kg/m3), instead of the mass, which follows from the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub density: Option<f64>,
    /// Position of its origin (m).
    pub position: [f64; 3],
    /// Orientation: roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Velocity of its centre of mass at the start, world axes (m/s). Default: at rest.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Initial angular velocity, world axes (rad/s).
    #[serde(default)]
    pub angular_velocity: [f64; 3],
    /// Coefficient of friction, default 0.8; 0 is frictionless on everything without a `friction_combine`.
    #[serde(default = "default_friction")]
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Rule by which frictions combine. Default: the mean of both surfaces' for a friction above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_combine: Option<FrictionCombine>,
    /// Torsional friction (m): torque about the normal per normal force; mean of both. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub torsional_friction: f64,
    /// Coefficient of rolling friction (m): torque against rolling per normal force. A contact uses the mean
    /// of both surfaces.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub rolling_friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. A contact uses the mean of both
    /// surfaces.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// A moving surface, as of a conveyor belt. Default: at rest.
    #[serde(default)]
    pub conveyor: Option<Conveyor>,
    /// Drag area: drag coefficient times frontal area (m2). The air pushes at its centre with half of the
    /// density times this times the square of the velocity relative to it. Without it, nothing.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub drag: f64,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    #[serde(default)]
    pub soft: Option<Softness>,
    /// Direction-dependent friction. Default: the same in all directions.
    #[serde(default)]
    pub grain: Option<Grain>,
    /// Copies in a pattern, called `NAME_0`, `NAME_1` and so on. After parsing, each is a separate object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copies: Option<Copies>,
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

/// Shapes of objects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ObjectShape {
    /// A box.
    Box {
        /// Full sides along x, y and z (m).
        size: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Full length (m).
        length: f64,
    },
    /// A capsule along z: a cylinder with half a sphere at each end.
    Capsule {
        /// Radius (m).
        radius: f64,
        /// Length of the cylinder, between the centres of the spheres (m).
        length: f64,
    },
    /// A mesh.
    Mesh(MeshShape),
    /// Several shapes that are rigidly joined.
    Compound(Vec<CompoundPart>),
}

/// Mass properties of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectMass {
    /// Mass \[kg\].
    pub mass: f64,
    /// Frame of the principal axes of inertia at the centre of mass, in the object; `None` if equal to the
    /// object's frame.
    pub frame: Option<Isometry3<f64>>,
    /// Principal moments of inertia about the centre of mass \[kg m2\].
    pub moments: Vector3<f64>,
}

impl Object {
    /// Pose of the object at the start.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy;
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }

    /// Returns `true` if it has a mass and therefore moves.
    pub fn is_dynamic(&self) -> bool {
        let of_parts = || match &self.shape {
            ObjectShape::Compound(parts) => compound::stated_mass(parts).is_some(),
            _ => false,
        };
        self.mass.is_some() || self.density.is_some() || of_parts()
    }

    /// Returns mass and inertia of a moving object; `None` for a fixed one, or one with an unreadable mesh.
    ///
    /// ```
    /// use motorium_robots::{Object, ObjectShape};
    ///
    /// let cube = Object { shape: ObjectShape::Box { size: [0.1; 3] }, density: Some(1000.0), ..Object::default() };
    /// assert!((cube.mass_properties().unwrap().mass - 1.0).abs() < 1e-12);
    /// ```
    pub fn mass_properties(&self) -> Option<ObjectMass> {
        let of_volume = || Some(self.density? * self.shape.volume()?);
        let of_parts = || match &self.shape {
            ObjectShape::Compound(parts) => compound::stated_mass(parts),
            _ => None,
        };
        self.shape.mass_properties(self.mass.or_else(of_volume).or_else(of_parts)?)
    }
}

impl ObjectShape {
    /// Resolves relative paths of its meshes from a folder.
    pub(super) fn locate(&mut self, folder: &Path) {
        match self {
            Self::Mesh(mesh) => mesh.locate(folder),
            Self::Compound(parts) => parts.iter_mut().for_each(|part| part.shape.locate(folder)),
            _ => {}
        }
    }

    /// Mass properties of `mass` \[kg\] spread over the shape; `None` for a mesh that cannot be read.
    pub(super) fn mass_properties(&self, mass: f64) -> Option<ObjectMass> {
        match self {
            Self::Compound(parts) => compound::mass_properties(parts, mass),
            Self::Mesh(mesh) => {
                let (frame, moments) = mesh.body().ok()?.properties?.principal();
                Some(ObjectMass { mass, frame: Some(frame), moments: moments * mass })
            }
            shape => Some(ObjectMass { mass, frame: None, moments: shape.principal_inertia(mass) }),
        }
    }

    /// Returns the volume \[m3\]; `None` for a mesh that is unreadable or has no volume. Overlapping parts of
    /// a compound each count.
    pub fn volume(&self) -> Option<f64> {
        use core::f64::consts::PI;
        Some(match self {
            Self::Box { size: [x, y, z] } => x * y * z,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Cylinder { radius, length } => PI * radius * radius * length,
            Self::Capsule { radius, length } => PI * radius * radius * (length + 4.0 / 3.0 * radius),
            Self::Mesh(mesh) => mesh.body().ok()?.properties?.volume,
            Self::Compound(parts) => return compound::volume(parts),
        })
    }

    /// Principal moments of inertia of `mass` \[kg\] spread evenly over the shape, about its centre of mass
    /// \[kg m2\].
    pub fn principal_inertia(&self, mass: f64) -> Vector3<f64> {
        match *self {
            Self::Box { size: [x, y, z] } => {
                Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (mass / 12.0)
            }
            Self::Sphere { radius } => Vector3::from_element(0.4 * mass * radius * radius),
            Self::Cylinder { radius, length } => {
                let across = mass * (3.0 * radius * radius + length * length) / 12.0;
                Vector3::new(across, across, 0.5 * mass * radius * radius)
            }
            Self::Capsule { radius, length } => {
                // The two halves of a sphere of this mass, each about its own centre of mass 3/8 of the
                // radius beyond the cylinder.
                let ends = mass * 4.0 * radius / (4.0 * radius + 3.0 * length);
                let rod = mass - ends;
                let squared = radius * radius;
                let across = rod * (3.0 * squared + length * length) / 12.0
                    + ends * (0.4 * squared + 0.25 * length * length + 0.375 * length * radius);
                Vector3::new(across, across, (0.5 * rod + 0.4 * ends) * squared)
            }
            Self::Mesh(_) | Self::Compound(_) => {
                self.mass_properties(mass).map_or(Vector3::repeat(f64::NAN), |own| own.moments)
            }
        }
    }

    /// Returns the collision shapes with their frames in the object; empty for an unreadable mesh.
    pub fn geometries(&self) -> Vec<(Isometry3<f64>, Geometry)> {
        let simple = match *self {
            Self::Box { size } => Geometry::Box { size: Vector3::from(size) },
            Self::Sphere { radius } => Geometry::Sphere { radius },
            Self::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
            Self::Capsule { radius, length } => Geometry::Capsule { radius, length },
            Self::Mesh(ref mesh) => {
                let name = mesh.file.display().to_string();
                let parts = mesh.body().map(|body| body.geometries(&name)).unwrap_or_default();
                return parts.into_iter().map(|part| (Isometry3::identity(), part)).collect();
            }
            Self::Compound(_) => {
                let of = |(frame, shape): (Isometry3<f64>, &Self)| {
                    let placed = move |(within, geometry)| (frame * within, geometry);
                    shape.geometries().into_iter().map(placed).collect::<Vec<_>>()
                };
                return self.shapes().into_iter().flat_map(of).collect();
            }
        };
        vec![(Isometry3::identity(), simple)]
    }

    /// Returns the convex shape; the hull for a mesh, `None` for a compound, whose [`shapes`](Self::shapes)
    /// have one each.
    pub fn convex_shape(&self) -> Option<ConvexShape> {
        Some(match *self {
            Self::Box { size } => ConvexShape::Box { half: Vector3::from(size) * 0.5 },
            Self::Sphere { radius } => ConvexShape::Sphere { radius },
            Self::Cylinder { radius, length } => ConvexShape::Cylinder { radius, half_length: 0.5 * length },
            Self::Capsule { radius, length } => ConvexShape::Capsule { radius, half_length: 0.5 * length },
            Self::Mesh(ref mesh) => {
                let hull = mesh.body().ok().and_then(|body| body.mesh.hull(usize::MAX));
                ConvexShape::Hull { points: hull.map(|hull| hull.points).unwrap_or_default() }
            }
            Self::Compound(_) => return None,
        })
    }

    /// Returns the geometry; `None` for a compound, whose [`shapes`](Self::shapes) have one each.
    pub fn geometry(&self) -> Option<Geometry> {
        match self {
            Self::Mesh(mesh) => Some(Geometry::Mesh {
                uri: mesh.file.display().to_string(),
                path: Some(mesh.file.clone()),
                inline: mesh.body().ok().map(|body| std::sync::Arc::new(body.mesh.clone())),
                scale: Vector3::repeat(1.0),
            }),
            Self::Compound(_) => None,
            simple => simple.geometries().into_iter().next().map(|(_, geometry)| geometry),
        }
    }

    pub(super) fn check(&self, owner: &str, moves: bool) -> Result<(), WorldError> {
        let dimensions = match *self {
            Self::Box { size: [x, y, z] } => [("size", x), ("size", y), ("size", z)],
            Self::Sphere { radius } => [("radius", radius); 3],
            Self::Cylinder { radius, length } | Self::Capsule { radius, length } => {
                [("radius", radius), ("length", length), ("length", length)]
            }
            Self::Mesh(ref mesh) => return mesh.check(owner, moves),
            Self::Compound(ref parts) => return compound::check(owner, parts, false),
        };
        dimensions.into_iter().try_for_each(|(field, value)| positive(owner, field, value))
    }
}
