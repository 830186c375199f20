//! Rates of a rotation vector, and the corresponding angular motion.

use nalgebra::Vector3;

use super::{coefficients, so3};

/// A rotation vector with its first and second time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RotationRates {
    /// Rotation vector \[rad\].
    pub vector: Vector3<f64>,
    /// First derivative \[rad/s\], which differs from the angular velocity.
    pub rate: Vector3<f64>,
    /// Second derivative \[rad/s2\].
    pub acceleration: Vector3<f64>,
}

/// Returns the angular velocity \[rad/s\] and angular acceleration \[rad/s2\] of the rotation `exp(phi) r` in
/// world axes, where `r` is constant.
pub fn angular_motion(phi: &RotationRates) -> (Vector3<f64>, Vector3<f64>) {
    let RotationRates { vector, rate, acceleration } = *phi;
    let angle = vector.norm();
    let ((a, b), (a_slope, b_slope)) = (coefficients::left(angle), coefficients::left_slopes(angle));
    let stretch = vector.dot(&rate);
    let once = vector.cross(&rate);
    let twice = vector.cross(&once);
    let velocity = rate + once * a + twice * b;
    let angular_acceleration = so3::left_jacobian(&vector) * acceleration
        + once * (a_slope * stretch)
        + twice * (b_slope * stretch)
        + rate.cross(&once) * b;
    (velocity, angular_acceleration)
}

/// Returns the rotation vector with its derivatives for an angular velocity \[rad/s\] and acceleration
/// \[rad/s2\] in world axes. This function is the inverse of [`angular_motion`]. Returns `None` at a full
/// revolution, where the left Jacobian is singular.
pub fn rotation_rates(
    vector: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
) -> Option<RotationRates> {
    let inverse = so3::left_jacobian(&vector).try_inverse()?;
    let rate = inverse * velocity;
    let (_, without) = angular_motion(&RotationRates { vector, rate, acceleration: Vector3::zeros() });
    Some(RotationRates { vector, rate, acceleration: inverse * (acceleration - without) })
}
