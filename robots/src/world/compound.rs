//! Objects of several shapes that are rigidly joined.

use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{MeshCollision, ObjectMass, ObjectShape, WorldError, finite, from_zero};
use crate::{BasePose, Inertia, VolumeProperties};

/// Parts of an object, at most.
const MOST_PARTS: usize = 64;

/// A part of an object of several shapes.
///
/// ```
/// use motorium_robots::Object;
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
    /// Shape; neither a compound nor a triangle-collision mesh.
    pub shape: ObjectShape,
    /// Position of its origin in the axes of the object (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes x, y, z of the object, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Mass (kg), for all parts or none. If the object has a `mass`, these are relative weights. Default:
    /// mass is distributed evenly over all parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub mass: Option<f64>,
}

impl CompoundPart {
    /// Frame of the part in the object.
    pub fn frame(&self) -> Isometry3<f64> {
        BasePose { position: self.position, rpy: self.rpy }.isometry()
    }
}

/// Total stated mass of the parts \[kg\].
pub(super) fn stated_mass(parts: &[CompoundPart]) -> Option<f64> {
    parts.iter().map(|part| part.mass).sum()
}

/// Volume \[m3\]: where parts overlap each counts.
pub(super) fn volume(parts: &[CompoundPart]) -> Option<f64> {
    parts.iter().map(|part| part.shape.volume()).sum()
}

/// Mass properties of parts of `mass` \[kg\] together.
pub(super) fn mass_properties(parts: &[CompoundPart], mass: f64) -> Option<ObjectMass> {
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

/// Checks the parts of an object; `owner` is its name, `density` is `true` if it states one.
pub(super) fn check(owner: &str, parts: &[CompoundPart], density: bool) -> Result<(), WorldError> {
    let wrong = |problem: &'static str| WorldError::Parts { name: owner.to_owned(), problem };
    if parts.is_empty() || parts.len() > MOST_PARTS {
        return Err(wrong("a compound has from 1 to 64 parts"));
    }
    for part in parts {
        match &part.shape {
            ObjectShape::Compound(_) => {
                return Err(wrong("a part is a compound itself; list its parts beside the others"));
            }
            ObjectShape::Mesh(mesh) if mesh.collision == MeshCollision::Triangles => {
                return Err(wrong("a part touches by its triangles; make it an object of its own"));
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
        return Err(wrong("some of its parts have a mass and others none; give it to all, or to none"));
    }
    if stated != 0 && density {
        return Err(wrong("its parts have masses, and it has a `density`; leave one out"));
    }
    if stated != 0 && stated_mass(parts) <= Some(0.0) {
        return Err(wrong("the masses of its parts are zero"));
    }
    Ok(())
}

impl ObjectShape {
    /// Inertia of `mass` \[kg\] spread evenly over the shape, in its axes.
    fn inertia(&self, mass: f64) -> Option<Inertia> {
        let ObjectMass { frame, moments, .. } = self.mass_properties(mass)?;
        let own =
            Inertia { mass, com: Vector3::zeros(), rotational: nalgebra::Matrix3::from_diagonal(&moments) };
        Some(frame.map_or(own, |frame| own.moved(&frame)))
    }

    /// Returns the individual shapes with their frames in the object: itself, or the parts of a compound.
    ///
    /// ```
    /// use motorium_robots::ObjectShape;
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
