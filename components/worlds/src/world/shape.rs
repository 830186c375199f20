//! Shapes of objects: primitives, meshes, and compounds of rigidly joined parts.

use std::path::Path;

use motorium_robots::{BasePose, ConvexShape, Geometry, Inertia, VolumeProperties};
use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::checks::{finite, from_zero, positive};
use super::{MeshCollision, MeshShape, WorldError};

/// Maximum number of parts of an object.
const MOST_PARTS: usize = 64;
/// Distance \[m\] and angle \[rad\] below which a shape counts as at the origin of its object.
const ALIGNED: f64 = 1e-12;

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
    /// Several rigidly joined shapes.
    Compound(Vec<CompoundPart>),
}

/// Mass properties of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectMass {
    /// Mass \[kg\].
    pub mass: f64,
    /// Frame of the principal axes of inertia, with the centre of mass as origin, as a pose in the object;
    /// `None` if this frame is the object's frame.
    pub frame: Option<Isometry3<f64>>,
    /// Principal moments of inertia about the centre of mass \[kg m2\].
    pub moments: Vector3<f64>,
}

/// One shape of a compound object, and its pose in the object.
///
/// ```
/// use motorium_worlds::Object;
///
/// let text = r#"
/// name     = "hammer"
/// position = [0.5, 0.0, 0.1]
/// shape    = { compound = [
///     { shape = { cylinder = { radius = 0.012, length = 0.3 } }, mass = 0.15 },
///     { shape = { box = { size = [0.1, 0.03, 0.03] } }, position = [0.0, 0.0, 0.15], mass = 0.45 },
/// ] }
/// "#;
/// let hammer: Object = toml::from_str(text).unwrap();
/// let own = hammer.mass_properties().unwrap();
/// let centre = own.frame.unwrap().translation.vector;
/// assert!((own.mass - 0.6).abs() < 1e-12 && (centre.z - 0.15 * 0.45 / 0.6).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompoundPart {
    /// Shape of the part; neither a compound nor a mesh with triangle collision.
    pub shape: ObjectShape,
    /// Position of the part's origin in the axes of the object (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// Orientation in the object: roll, pitch, yaw about the object's fixed axes x, y, z, in this order
    /// (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Mass of the part (kg). Either all parts have a mass, or no part has. If the object has a `mass`, the
    /// parts' masses are relative weights that distribute it. Default: all parts have the same density.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub mass: Option<f64>,
}

impl CompoundPart {
    /// Returns the pose of the part in the object.
    pub fn frame(&self) -> Isometry3<f64> {
        BasePose { position: self.position, rpy: self.rpy }.isometry()
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

    /// Returns the mass properties of `mass` \[kg\] distributed evenly over the shape; `None` for an
    /// unreadable mesh.
    pub(super) fn mass_properties(&self, mass: f64) -> Option<ObjectMass> {
        match self {
            Self::Compound(parts) => parts_mass(parts, mass),
            Self::Mesh(mesh) => {
                let (frame, moments) = mesh.body().ok()?.properties?.principal();
                Some(ObjectMass { mass, frame: Some(frame), moments: moments * mass })
            }
            shape => Some(ObjectMass { mass, frame: None, moments: shape.principal_inertia(mass) }),
        }
    }

    /// Returns the volume \[m3\]; `None` for a mesh that is unreadable or has no volume. Overlapping parts of
    /// a compound are each counted in full.
    pub fn volume(&self) -> Option<f64> {
        use core::f64::consts::PI;
        Some(match self {
            Self::Box { size: [x, y, z] } => x * y * z,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Cylinder { radius, length } => PI * radius * radius * length,
            Self::Capsule { radius, length } => PI * radius * radius * (length + 4.0 / 3.0 * radius),
            Self::Mesh(mesh) => mesh.body().ok()?.properties?.volume,
            Self::Compound(parts) => return parts_volume(parts),
        })
    }

    /// Returns the principal moments of inertia of `mass` \[kg\] distributed evenly over the shape, about its
    /// centre of mass \[kg m2\].
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
                // Two hemispheres with this total mass, each about its own centre of mass 3/8 of the radius
                // beyond the cylinder.
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

    /// Returns the collision shapes with their poses in the object; empty for an unreadable mesh.
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

    /// Returns the convex shape; for a mesh, its convex hull. Returns `None` for an unreadable mesh, and for
    /// a compound, whose parts are returned by [`shapes`](Self::shapes).
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

    /// Returns the geometry; `None` for a compound, whose parts are returned by [`shapes`](Self::shapes).
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
            Self::Compound(ref parts) => return check_parts(owner, parts, false),
        };
        dimensions.into_iter().try_for_each(|(field, value)| positive(owner, field, value))
    }
}

impl ObjectShape {
    /// Returns the inertia of `mass` \[kg\] distributed evenly over the shape, in its axes.
    fn inertia(&self, mass: f64) -> Option<Inertia> {
        let ObjectMass { frame, moments, .. } = self.mass_properties(mass)?;
        let own =
            Inertia { mass, com: Vector3::zeros(), rotational: nalgebra::Matrix3::from_diagonal(&moments) };
        Some(frame.map_or(own, |frame| own.moved(&frame)))
    }

    /// Returns the shape at `frame` in its object: itself at the origin, otherwise a compound with this part.
    pub(super) fn displaced(self, frame: &Isometry3<f64>) -> Self {
        if frame.translation.vector.norm() < ALIGNED && frame.rotation.angle() < ALIGNED {
            return self;
        }
        let BasePose { position, rpy } = BasePose::from_isometry(frame);
        Self::Compound(vec![CompoundPart { shape: self, position, rpy, mass: None }])
    }

    /// Returns the individual shapes with their poses in the object: the shape itself, or the parts of a
    /// compound.
    ///
    /// ```
    /// use motorium_worlds::ObjectShape;
    ///
    /// assert_eq!(ObjectShape::Sphere { radius: 0.1 }.shapes().len(), 1);
    /// ```
    pub fn shapes(&self) -> Vec<(Isometry3<f64>, &Self)> {
        match self {
            Self::Compound(parts) => parts.iter().map(|part| (part.frame(), &part.shape)).collect(),
            simple => vec![(Isometry3::identity(), simple)],
        }
    }
}

/// Returns the total specified mass of the parts \[kg\].
pub(super) fn stated_mass(parts: &[CompoundPart]) -> Option<f64> {
    parts.iter().map(|part| part.mass).sum()
}

/// Returns the total volume \[m3\]; overlapping parts are each counted in full.
fn parts_volume(parts: &[CompoundPart]) -> Option<f64> {
    parts.iter().map(|part| part.shape.volume()).sum()
}

/// Returns the mass properties of parts with the total mass `mass` \[kg\].
fn parts_mass(parts: &[CompoundPart], mass: f64) -> Option<ObjectMass> {
    let shares: Option<Vec<f64>> = match stated_mass(parts) {
        Some(_) => parts.iter().map(|part| part.mass).collect(),
        None => parts.iter().map(|part| part.shape.volume()).collect(),
    };
    let shares = shares?;
    let all: f64 = shares.iter().sum();
    let mut sum = Inertia::zero();
    for (part, share) in parts.iter().zip(shares) {
        sum = sum.merged(&part.shape.inertia(mass * share / all)?.moved(&part.frame()));
    }
    let properties = VolumeProperties { volume: 1.0, centre: sum.com, inertia: sum.rotational };
    let (frame, moments) = properties.principal();
    Some(ObjectMass { mass, frame: Some(frame), moments })
}

/// Checks the parts of an object; `owner` is its name, and `density` is `true` if it has a density.
pub(super) fn check_parts(owner: &str, parts: &[CompoundPart], density: bool) -> Result<(), WorldError> {
    let wrong = |problem: &'static str| WorldError::Parts { name: owner.to_owned(), problem };
    if parts.is_empty() || parts.len() > MOST_PARTS {
        return Err(wrong("a compound must have from 1 to 64 parts"));
    }
    for part in parts {
        match &part.shape {
            ObjectShape::Compound(_) => {
                return Err(wrong(
                    "a part of a compound is itself a compound; list all parts in one compound",
                ));
            }
            ObjectShape::Mesh(mesh) if mesh.collision == MeshCollision::Triangles => {
                return Err(wrong(
                    "triangle collision is not supported for a part of a compound; make the part a separate object",
                ));
            }
            shape => shape.check(owner, true)?,
        }
        for value in part.position.into_iter().chain(part.rpy) {
            finite(owner, "position or rpy of a part", value)?;
        }
        part.mass.map_or(Ok(()), |mass| from_zero(owner, "mass of a part", mass))?;
    }
    let stated = parts.iter().filter(|part| part.mass.is_some()).count();
    if stated != 0 && stated != parts.len() {
        return Err(wrong(
            "some of its parts have a mass and others do not; specify a mass for all parts or for no part",
        ));
    }
    if stated != 0 && density {
        return Err(wrong(
            "its parts have masses, but the object also has a `density`; remove one of the two",
        ));
    }
    if stated != 0 && stated_mass(parts) <= Some(0.0) {
        return Err(wrong("the masses of all its parts are zero; make at least one positive"));
    }
    Ok(())
}
