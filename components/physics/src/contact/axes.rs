//! The axes of a contact point.

use nalgebra::Vector3;

/// The normal and two unit vectors square to it and to one another. They are continuous in it except where
/// the chosen axis changes.
pub(super) fn axes(normal: &Vector3<f64>) -> [Vector3<f64>; 3] {
    let axis = if normal.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    let one = (axis - normal * normal.dot(&axis)).normalize();
    [*normal, one, normal.cross(&one)]
}
