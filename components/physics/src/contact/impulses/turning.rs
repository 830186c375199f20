//! Jacobians of angular velocities.

use nalgebra::{Point3, Vector3};

use super::super::colliders::Owner;

/// Adds `sign` times the Jacobian of an owner's angular velocity about the three axes to `columns`.
pub(super) fn add_turning(
    slopes: impl Fn(Owner, &Point3<f64>, &[Vector3<f64>; 3], f64, &mut [[f64; 4]]),
    (owner, sign): (Owner, f64),
    point: &Point3<f64>,
    [normal, one, other]: [Vector3<f64>; 3],
    columns: &mut [[f64; 4]],
) {
    // The angular velocity about an axis equals the velocity, relative to the contact point, of a point one
    // unit away along the next axis, measured along the axis after that.
    let none = Vector3::zeros();
    let mut add = |arm: &Vector3<f64>, axes: [Vector3<f64>; 3], sign: f64| {
        slopes(owner, &(point + arm), &axes, sign, columns);
    };
    add(&one, [other, none, none], sign);
    add(&other, [none, normal, none], sign);
    add(&normal, [none, none, one], sign);
    add(&none, [other, normal, one], -sign);
}
