//! Convex shapes in the types of rapier and of rapier's collision library.

use std::f64::consts::FRAC_PI_2;

use motorium_robots::ConvexShape;
use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::geometry::SharedShape;
use rapier3d_f64::math::Vector;

/// A vector in rapier's type.
pub(crate) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// Returns the rapier shape and its frame in the frame of `shape`; `None` for a hull without volume.
pub(crate) fn rapier_shape(shape: &ConvexShape) -> Option<(SharedShape, Isometry3<f64>)> {
    let upright = match shape {
        ConvexShape::Sphere { radius } => SharedShape::ball(*radius),
        ConvexShape::Box { half } => SharedShape::cuboid(half.x, half.y, half.z),
        ConvexShape::Capsule { radius, half_length } => SharedShape::capsule_z(*half_length, *radius),
        ConvexShape::Hull { points } => {
            let points: Vec<Vector> = points.iter().map(vector).collect();
            SharedShape::convex_hull(&points)?
        }
        ConvexShape::HalfSpace => SharedShape::halfspace(Vector::Z),
        ConvexShape::Cylinder { radius, half_length } => {
            // Rapier's cylinders have their axis along y.
            let shape = SharedShape::cylinder(*half_length, *radius);
            return Some((shape, Isometry3::rotation(Vector3::x() * FRAC_PI_2)));
        }
    };
    Some((upright, Isometry3::identity()))
}
