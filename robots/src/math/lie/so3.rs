//! SO(3), the rotations of space, as unit quaternions and rotation vectors \[rad\].

use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};

use super::coefficients;

/// Returns the exponential of a rotation vector: the rotation by `|phi|` rad about `phi`.
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let (sin, cos) = (0.5 * phi.norm()).sin_cos();
    // sin(t/2) / t tends to 1/2; below this angle the difference is under half a unit in the last place
    let angle = phi.norm();
    let factor = if angle < 1e-8 { 0.5 } else { sin / angle };
    UnitQuaternion::new_normalize(Quaternion::from_parts(cos, phi * factor))
}

/// Returns the logarithm of a rotation: the shortest rotation vector, of length at most pi. `q` and `-q` give
/// the same vector. At a rotation of exactly pi, one of the two opposite vectors is chosen.
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    let (real, imaginary) = (rotation.w * sign, rotation.imag() * sign);
    let sine = imaginary.norm();
    // 2 atan2(s, c) / s tends to 2 / c.
    let factor = if sine < 1e-9 { 2.0 / real } else { 2.0 * sine.atan2(real) / sine };
    imaginary * factor
}

/// Returns the left Jacobian `1 + a [phi] + b [phi]^2`, with `a = (1 - cos t) / t^2`, `b = (t - sin t) / t^3`
/// and `t = |phi|`.
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (a, b) = coefficients::left(phi.norm());
    let cross = phi.cross_matrix();
    Matrix3::identity() + cross * a + cross * cross * b
}

/// Returns the inverse of the left Jacobian, for `|phi|` below 2 pi. The left Jacobian is singular at 2 pi.
pub fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let cross = phi.cross_matrix();
    Matrix3::identity() - cross * 0.5 + cross * cross * coefficients::left_inverse(phi.norm())
}

/// Returns the right Jacobian at `phi`. It equals both the left Jacobian at `-phi` and the transpose of the
/// left Jacobian at `phi`.
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian(&-phi)
}

/// Returns the inverse of the right Jacobian, for `|phi|` below 2 pi.
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian_inverse(&-phi)
}

/// Returns the smallest rotation from `from` to `to`. For vectors that are opposite up to rounding, the
/// result is a rotation by pi about an axis perpendicular to `from`.
///
/// The result is accurate to rounding at every angle: sine and cosine of half the angle are computed from the
/// lengths of the vectors' difference and sum.
pub fn least_rotation(from: &Unit<Vector3<f64>>, to: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    let (from, to) = (from.into_inner(), to.into_inner());
    let (sum, difference) = (from + to, from - to);
    let (cosine, sine) = (0.5 * sum.norm(), 0.5 * difference.norm());
    let mut axis = from.cross(&to);
    if axis.norm() < 1e-20 {
        if cosine > sine {
            return UnitQuaternion::identity();
        }
        axis = from.cross(&Vector3::ith(from.iamin(), 1.0));
    }
    // Exactly normal to the longer vector, so that `from` maps to `to` even if they are nearly opposite.
    let longer = if cosine > sine { sum } else { difference };
    axis = axis.normalize();
    axis -= longer * (axis.dot(&longer) / longer.norm_squared());
    UnitQuaternion::new_normalize(Quaternion::from_parts(cosine, axis.normalize() * sine))
}
