//! The axes of a contact point.

use nalgebra::Vector3;

/// Returns the normal and two unit vectors perpendicular to it and to each other. They depend continuously on
/// the normal except where the chosen axis changes.
pub(super) fn axes(normal: &Vector3<f64>) -> [Vector3<f64>; 3] {
    let axis = if normal.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    let one = (axis - normal * normal.dot(&axis)).normalize();
    [*normal, one, normal.cross(&one)]
}
