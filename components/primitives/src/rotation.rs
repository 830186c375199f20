//! Rotation vectors: exponential and logarithm of unit quaternions, and how their rates relate to angular velocity.
//!
//! A rotation vector `phi` (rad) stands for the rotation by `|phi|` about `phi`. When `q = exp(phi) q_ref`, with `q_ref`
//! at rest, the angular velocity in world axes is `omega = J(phi) phi'`, with the left Jacobian of SO(3)
//! `J = I + a [phi] + b [phi]^2`, `a = (1 - cos t) / t^2`, `b = (t - sin t) / t^3`, `t = |phi|`
//! (Chirikjian 2012; Sola et al. 2018, eq. 145).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A rotation vector with its first and second time derivative: rad, rad/s, rad/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RotationJet {
    /// The rotation vector, rad.
    pub vector: Vector3<f64>,
    /// Its rate, rad/s. Not an angular velocity.
    pub rate: Vector3<f64>,
    /// The rate of its rate, rad/s^2.
    pub acceleration: Vector3<f64>,
}

/// The unit quaternion of a rotation vector.
pub fn exp(vector: Vector3<f64>) -> UnitQuaternion<f64> {
    let half = 0.5 * vector.norm();
    // sin(half) / (2 half), from its series where the quotient loses its digits
    let factor = if half < 1e-4 { 0.5 - half * half / 12.0 } else { 0.5 * half.sin() / half };
    UnitQuaternion::new_normalize(Quaternion::from_parts(half.cos(), factor * vector))
}

/// The shortest rotation vector of a unit quaternion, of length at most pi. `q` and `-q` give the same.
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (scalar, vector) =
        if rotation.w < 0.0 { (-rotation.w, -rotation.imag()) } else { (rotation.w, rotation.imag()) };
    let sine = vector.norm();
    // 2 atan2(s, c) / s tends to 2 / c
    let factor = if sine < 1e-9 { 2.0 / scalar } else { 2.0 * sine.atan2(scalar) / sine };
    factor * vector
}

/// `a, b` of the left Jacobian and their derivatives by `t`, divided by `t`.
fn coefficients(squared: f64) -> [f64; 4] {
    if squared < 0.01 {
        let s = squared;
        return [
            0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40_320.0 - s / 3_628_800.0))),
            1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s * (1.0 / 362_880.0 - s / 39_916_800.0))),
            -1.0 / 12.0 + s * (1.0 / 180.0 - s * (1.0 / 6720.0 - s * (1.0 / 453_600.0))),
            -1.0 / 60.0 + s * (1.0 / 1260.0 - s * (1.0 / 60_480.0 - s * (1.0 / 4_989_600.0))),
        ];
    }
    let t = squared.sqrt();
    let (sine, cosine) = t.sin_cos();
    let a = (1.0 - cosine) / squared;
    let b = (t - sine) / (squared * t);
    [a, b, (sine / t - 2.0 * a) / squared, (a - 3.0 * b) / squared]
}

/// Angular velocity (rad/s) and angular acceleration (rad/s^2), both in world axes, of `exp(phi) q_ref`.
pub fn angular_motion(phi: &RotationJet) -> (Vector3<f64>, Vector3<f64>) {
    let RotationJet { vector, rate, acceleration } = *phi;
    let [a, b, a_slope, b_slope] = coefficients(vector.norm_squared());
    let stretch = vector.dot(&rate);
    let (once, twice) = (vector.cross(&rate), vector.cross(&vector.cross(&rate)));
    let velocity = rate + a * once + b * twice;
    let angular_acceleration = left_jacobian(vector) * acceleration
        + a_slope * stretch * once
        + b_slope * stretch * twice
        + b * rate.cross(&once);
    (velocity, angular_acceleration)
}

/// The rates of the rotation vector that go with an angular velocity and acceleration in world axes: the inverse of
/// [`angular_motion`]. Defined for rotations short of a full turn, where the Jacobian is regular.
pub fn from_angular_motion(
    vector: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
) -> Option<RotationJet> {
    let inverse = left_jacobian(vector).try_inverse()?;
    let rate = inverse * velocity;
    let (_, without) = angular_motion(&RotationJet { vector, rate, acceleration: Vector3::zeros() });
    Some(RotationJet { vector, rate, acceleration: inverse * (acceleration - without) })
}

/// The left Jacobian of SO(3).
pub fn left_jacobian(vector: Vector3<f64>) -> Matrix3<f64> {
    let [a, b, ..] = coefficients(vector.norm_squared());
    let cross = vector.cross_matrix();
    Matrix3::identity() + a * cross + b * cross * cross
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> Vec<Vector3<f64>> {
        let directions = [[1.0, 0.0, 0.0], [0.3, -0.9, 0.2], [-0.5, 0.5, 0.7]];
        let lengths = [0.0, 1e-12, 1e-6, 1e-3, 0.0999, 0.1001, 1.0, 3.0];
        let unit = |d: [f64; 3]| Vector3::from(d).normalize();
        directions.iter().flat_map(|d| lengths.map(|length| length * unit(*d))).collect()
    }

    #[test]
    fn log_undoes_exp_to_rounding_from_no_turn_to_nearly_half_a_turn() {
        for vector in samples() {
            assert!((log(&exp(vector)) - vector).norm() <= 1e-15 + 1e-14 * vector.norm());
        }
    }

    #[test]
    fn exp_agrees_with_nalgebra() {
        for vector in samples() {
            assert!(exp(vector).angle_to(&UnitQuaternion::from_scaled_axis(vector)) < 1e-7);
            assert!((exp(vector).coords - UnitQuaternion::from_scaled_axis(vector).coords).norm() < 1e-15);
        }
    }

    #[test]
    fn both_signs_of_a_quaternion_have_the_same_logarithm() {
        let q = exp(Vector3::new(0.4, 2.0, -0.3));
        let negated = UnitQuaternion::new_unchecked(-q.into_inner());
        assert!((log(&q) - log(&negated)).norm() < 1e-15);
    }

    /// The path `phi(t)` is a parabola; the angular velocity is read off the quaternions it passes through.
    #[test]
    fn angular_motion_agrees_with_finite_differences_of_the_rotation() {
        for vector in samples() {
            let rate = Vector3::new(0.7, -1.1, 0.4);
            let acceleration = Vector3::new(-2.0, 0.3, 1.5);
            let at = |t: f64| RotationJet {
                vector: vector + rate * t + 0.5 * acceleration * t * t,
                rate: rate + acceleration * t,
                acceleration,
            };
            let h = 1e-4;
            let (before, here, after) = (exp(at(-h).vector), exp(vector), exp(at(h).vector));
            let difference = log(&(after * before.inverse())) / (2.0 * h);
            let (velocity, angular_acceleration) = angular_motion(&at(0.0));
            assert!((velocity - difference).norm() < 1e-7, "{velocity} {difference}");
            let second = (log(&(after * here.inverse())) + log(&(before * here.inverse()))) / (h * h);
            assert!(
                (angular_acceleration - second).norm() < 1e-6,
                "at {vector}: {angular_acceleration} {second}"
            );
        }
    }

    #[test]
    fn the_series_meets_the_closed_form_where_they_change_over() {
        let (below, above) = (coefficients(0.01 - 1e-12), coefficients(0.01));
        for (series, closed) in below.iter().zip(above) {
            assert!((series - closed).abs() < 1e-10, "{below:?} {above:?}");
        }
    }

    #[test]
    fn the_rates_of_an_angular_motion_lead_back_to_it() {
        for vector in samples() {
            let (velocity, acceleration) = (Vector3::new(1.0, 2.0, -0.5), Vector3::new(0.1, -3.0, 2.0));
            let jet = from_angular_motion(vector, velocity, acceleration).unwrap();
            let (back, back_acceleration) = angular_motion(&jet);
            assert!((back - velocity).norm() < 1e-12 && (back_acceleration - acceleration).norm() < 1e-11);
        }
    }
}
