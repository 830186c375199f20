//! SE(3), the rigid motions of space, as isometries and twists: linear \[m\], then angular \[rad\].

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};

use super::{coefficients, so3};

/// Returns the exponential of a twist: the pose that a frame reaches from the identity in unit time with the
/// constant twist `xi`.
pub fn exp(xi: &Vector6<f64>) -> Isometry3<f64> {
    let (rho, phi) = split(xi);
    let (a, b) = coefficients::left(phi.norm());
    let across = phi.cross(&rho);
    let translation = rho + across * a + phi.cross(&across) * b;
    Isometry3::from_parts(Translation3::from(translation), so3::exp(&phi))
}

/// Returns the logarithm of a motion: the twist that reaches `motion` from the identity in unit time, with
/// the smallest rotation, at most pi. At a rotation of exactly pi, one of the two opposite rotations is
/// chosen.
pub fn log(motion: &Isometry3<f64>) -> Vector6<f64> {
    let phi = so3::log(&motion.rotation);
    let t = motion.translation.vector;
    let across = phi.cross(&t);
    let rho = t - across * 0.5 + phi.cross(&across) * coefficients::left_inverse(phi.norm());
    stack(&rho, &phi)
}

/// Returns the derivative of [`log`], such that `d/dt log(M) = log_jacobian(M) * twist`. Here `twist` is the
/// body velocity of `M`, `M^-1 dM/dt`. The result is the inverse of the right Jacobian at `log(M)`.
pub fn log_jacobian(motion: &Isometry3<f64>) -> Matrix6<f64> {
    right_jacobian_inverse(&log(motion))
}

/// Returns the left Jacobian at `xi`: the derivative of [`exp`] as a velocity in world axes.
pub fn left_jacobian(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (rho, phi) = split(xi);
    triangular(&so3::left_jacobian(&phi), &coupling(&rho, &phi))
}

/// Returns the inverse of the left Jacobian, for rotations below 2 pi. The left Jacobian is singular at 2 pi.
pub fn left_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    let (rho, phi) = split(xi);
    let rotation = so3::left_jacobian_inverse(&phi);
    triangular(&rotation, &(-rotation * coupling(&rho, &phi) * rotation))
}

/// Returns the right Jacobian at `xi`, which is the left Jacobian at `-xi`.
pub fn right_jacobian(xi: &Vector6<f64>) -> Matrix6<f64> {
    left_jacobian(&-xi)
}

/// Returns the inverse of the right Jacobian, for rotations below 2 pi.
pub fn right_jacobian_inverse(xi: &Vector6<f64>) -> Matrix6<f64> {
    left_jacobian_inverse(&-xi)
}

/// Returns the adjoint of `motion`, the pose of a frame A in a frame B. The adjoint maps a spatial velocity
/// at the origin and in the axes of A to the same velocity at the origin and in the axes of B.
pub fn adjoint(motion: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation = motion.rotation.to_rotation_matrix().into_inner();
    triangular(&rotation, &(motion.translation.vector.cross_matrix() * rotation))
}

/// Stacks a linear and an angular part into one vector, linear part first.
pub fn stack(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

fn split(xi: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned())
}

/// `[diagonal, coupling; 0, diagonal]`
fn triangular(diagonal: &Matrix3<f64>, coupling: &Matrix3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(diagonal);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(coupling);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(diagonal);
    matrix
}

/// Returns the off-diagonal block of the left Jacobian (Barfoot, equation 7.86b).
fn coupling(rho: &Vector3<f64>, phi: &Vector3<f64>) -> Matrix3<f64> {
    let (r, p) = (rho.cross_matrix(), phi.cross_matrix());
    let (c1, c2, c3) = coefficients::coupling(phi.norm());
    let (pr, rp) = (p * r, r * p);
    let prp = pr * p;
    r * 0.5 + (pr + rp + prp) * c1 + (p * pr + rp * p - prp * 3.0) * c2 + (prp * p + p * prp) * c3
}
