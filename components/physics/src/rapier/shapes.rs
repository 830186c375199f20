//! Shapes of robots and objects as rapier's.

use std::f64::consts::FRAC_PI_2;

use motorium_robots::Geometry;
use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::geometry::SharedShape;

use crate::ObjectShape;

/// The shape and its frame in that of the geometry; `None` for a mesh.
pub(super) fn of_geometry(geometry: &Geometry) -> Option<(SharedShape, Isometry3<f64>)> {
    match geometry {
        Geometry::Box { size } => Some(cuboid(size)),
        Geometry::Cylinder { radius, length } => Some(cylinder(*radius, *length)),
        Geometry::Sphere { radius } => Some(sphere(*radius)),
        Geometry::Capsule { radius, length } => {
            Some((SharedShape::capsule_z(0.5 * length, *radius), Isometry3::identity()))
        }
        Geometry::Mesh { .. } => None,
    }
}

/// The shape and its frame in that of the object.
pub(super) fn of_object(shape: &ObjectShape) -> (SharedShape, Isometry3<f64>) {
    match *shape {
        ObjectShape::Box { size } => cuboid(&Vector3::from(size)),
        ObjectShape::Sphere { radius } => sphere(radius),
        ObjectShape::Cylinder { radius, length } => cylinder(radius, length),
    }
}

fn cuboid(size: &Vector3<f64>) -> (SharedShape, Isometry3<f64>) {
    (SharedShape::cuboid(0.5 * size.x, 0.5 * size.y, 0.5 * size.z), Isometry3::identity())
}

fn sphere(radius: f64) -> (SharedShape, Isometry3<f64>) {
    (SharedShape::ball(radius), Isometry3::identity())
}

/// Rapier's cylinders stand along y, ours along z.
fn cylinder(radius: f64, length: f64) -> (SharedShape, Isometry3<f64>) {
    (SharedShape::cylinder(0.5 * length, radius), Isometry3::rotation(Vector3::x() * FRAC_PI_2))
}
