//! Rigid motions as vectors: the logarithm of SE(3) and its derivative.
//!
//! A twist is ordered linear first, angular second. References: Barfoot, *State Estimation for Robotics*, 7.1;
//! Sola, Deray, Atchuthan, *A micro Lie theory for state estimation in robotics*, 2018.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};

/// Below this angle \[rad\] the closed forms lose digits to cancellation and power series are used.
const SMALL_ANGLE: f64 = 0.25;

/// The twist that carries the identity to `motion` in one unit of time: linear \[m\], angular \[rad\].
///
/// The angle of the rotation is in `[0, pi]`; at exactly pi one of the two equal axes is chosen.
pub fn log(motion: &Isometry3<f64>) -> Vector6<f64> {
    let phi = motion.rotation.scaled_axis();
    let t = motion.translation.vector;
    // V^-1 t, with V the left Jacobian of SO(3)
    let half = phi.cross(&t) * 0.5;
    let rho = t - half + phi.cross(&phi.cross(&t)) * inverse_coefficient(phi.norm());
    stack(&rho, &phi)
}

/// Derivative of [`log`]: `d/dt log(M) = log_jacobian(M) * twist`, where `twist` is the body velocity of `M`,
/// `M^-1 dM/dt` (the inverse of the right Jacobian of SE(3)).
pub fn log_jacobian(motion: &Isometry3<f64>) -> Matrix6<f64> {
    let xi = log(motion);
    let (rho, phi) = (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned());
    // the right Jacobian at xi is the left one at -xi
    let rotation = left_jacobian_inverse(&-phi);
    let coupling = -rotation * left_coupling(&-rho, &-phi) * rotation;
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&coupling);
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    jacobian
}

/// Linear and angular part as one vector.
pub fn stack(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// Inverse of the left Jacobian of SO(3) at the rotation vector `phi`.
fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let hat = phi.cross_matrix();
    Matrix3::identity() - hat * 0.5 + hat * hat * inverse_coefficient(phi.norm())
}

/// `1/t^2 - (1 + cos t) / (2 t sin t)`, the factor of the square in the inverse left Jacobian.
fn inverse_coefficient(t: f64) -> f64 {
    let t2 = t * t;
    if t < SMALL_ANGLE {
        1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 + t2 * (1.0 / 1_209_600.0 + t2 / 47_900_160.0)))
    } else {
        // (1 + cos) / sin = cot(t/2) stays finite at pi
        t2.recip() - 0.5 / (t * (0.5 * t).tan())
    }
}

/// The off-diagonal block of the left Jacobian of SE(3) at `(rho, phi)` (Barfoot, equation 7.86b).
fn left_coupling(rho: &Vector3<f64>, phi: &Vector3<f64>) -> Matrix3<f64> {
    let (r, p) = (rho.cross_matrix(), phi.cross_matrix());
    let (c1, c2, c3) = coupling_coefficients(phi.norm());
    let (pr, rp) = (p * r, r * p);
    let prp = pr * p;
    r * 0.5 + (pr + rp + prp) * c1 + (p * pr + rp * p - prp * 3.0) * c2 + (prp * p + p * prp) * c3
}

/// `(t - sin t) / t^3`, `(t^2 + 2 cos t - 2) / (2 t^4)`, `(2 t - 3 sin t + t cos t) / (2 t^5)`.
fn coupling_coefficients(t: f64) -> (f64, f64, f64) {
    let t2 = t * t;
    if t < SMALL_ANGLE {
        (
            1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 * (1.0 / 5040.0 - t2 * (1.0 / 362_880.0 - t2 / 39_916_800.0))),
            1.0 / 24.0
                - t2 * (1.0 / 720.0 - t2 * (1.0 / 40320.0 - t2 * (1.0 / 3_628_800.0 - t2 / 479_001_600.0))),
            1.0 / 120.0
                - t2 * (1.0 / 2520.0
                    - t2 * (1.0 / 120_960.0 - t2 * (1.0 / 9_979_200.0 - t2 / 1_245_404_160.0))),
        )
    } else {
        let (sin, cos) = t.sin_cos();
        (
            (t - sin) / (t2 * t),
            (t2 + 2.0 * cos - 2.0) / (2.0 * t2 * t2),
            (2.0 * t - 3.0 * sin + t * cos) / (2.0 * t2 * t2 * t),
        )
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix4, UnitQuaternion};
    use std::f64::consts::PI;

    use super::*;

    fn exp_by_power_series(xi: &Vector6<f64>) -> Isometry3<f64> {
        let hat = Vector3::new(xi[3], xi[4], xi[5]).cross_matrix();
        let mut a = Matrix4::zeros();
        a.fixed_view_mut::<3, 3>(0, 0).copy_from(&hat);
        a.fixed_view_mut::<3, 1>(0, 3).copy_from(&xi.fixed_rows::<3>(0));
        let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
        for k in 1..60 {
            term = term * a / f64::from(k);
            sum += term;
        }
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(sum.fixed_view::<3, 3>(0, 0).into_owned());
        let translation = Vector3::new(sum[(0, 3)], sum[(1, 3)], sum[(2, 3)]);
        Isometry3::from_parts(translation.into(), UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// Twists whose angle spans tiny, the seam between series and closed form, and almost pi.
    fn twists() -> Vec<Vector6<f64>> {
        let directions =
            [(Vector3::new(0.3, -0.5, 0.8), Vector3::new(1.0, 2.0, -0.5)), (Vector3::z(), Vector3::x())];
        let angles = [0.0, 1e-9, 1e-4, 0.1, SMALL_ANGLE - 1e-9, SMALL_ANGLE + 1e-9, 1.0, 2.5, 3.1, PI - 1e-6];
        directions
            .iter()
            .flat_map(|(rho, axis)| angles.map(|angle| stack(rho, &(axis.normalize() * angle))))
            .collect()
    }

    #[test]
    fn the_logarithm_undoes_the_exponential() {
        for xi in twists() {
            assert_abs_diff_eq!(log(&exp_by_power_series(&xi)), xi, epsilon = 1e-9);
        }
    }

    #[test]
    fn the_logarithm_of_half_a_turn_is_finite_and_of_length_pi() {
        for axis in [Vector3::x(), Vector3::y(), Vector3::new(1.0, -1.0, 0.5)] {
            let rotation = UnitQuaternion::from_scaled_axis(axis.normalize() * PI);
            let motion = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), rotation);
            let xi = log(&motion);
            assert_abs_diff_eq!(xi.fixed_rows::<3>(3).norm(), PI, epsilon = 1e-12);
            assert_abs_diff_eq!(
                exp_by_power_series(&xi).to_homogeneous(),
                motion.to_homogeneous(),
                epsilon = 1e-9
            );
            assert!(log_jacobian(&motion).iter().all(|entry| entry.is_finite()));
        }
    }

    #[test]
    fn the_jacobian_of_the_logarithm_agrees_with_finite_differences() {
        let h = 1e-6;
        for xi in twists() {
            let motion = exp_by_power_series(&xi);
            // central differences may not step across the cut at pi
            if xi.fixed_rows::<3>(3).norm() > PI - 1e-3 {
                continue;
            }
            let jacobian = log_jacobian(&motion);
            for axis in 0..6 {
                let mut step = Vector6::zeros();
                step[axis] = h;
                let ahead = log(&(motion * exp_by_power_series(&step)));
                let behind = log(&(motion * exp_by_power_series(&-step)));
                let difference = (ahead - behind) / (2.0 * h);
                assert_abs_diff_eq!(jacobian.column(axis).into_owned(), difference, epsilon = 2e-8);
            }
        }
    }

    #[test]
    fn series_and_closed_form_meet_at_the_seam() {
        let below = coupling_coefficients(SMALL_ANGLE - 1e-12);
        let above = coupling_coefficients(SMALL_ANGLE + 1e-12);
        assert_abs_diff_eq!(below.0, above.0, epsilon = 1e-12);
        assert_abs_diff_eq!(below.1, above.1, epsilon = 1e-12);
        assert_abs_diff_eq!(below.2, above.2, epsilon = 1e-11);
        let (below, above) =
            (inverse_coefficient(SMALL_ANGLE - 1e-12), inverse_coefficient(SMALL_ANGLE + 1e-12));
        assert_abs_diff_eq!(below, above, epsilon = 1e-13);
    }
}
