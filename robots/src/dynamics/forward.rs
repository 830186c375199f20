//! Forward dynamics through the mass matrix.

use nalgebra::{DMatrix, Vector3};

use super::Dynamics;
use crate::Model;

/// The mass matrix is not positive definite: some joint moves nothing that has inertia.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the mass matrix is not positive definite at joint {index} of q: the links beyond it have no inertia; \
     give them a mass and a rotational inertia, or make the joint fixed"
)]
pub struct SingularMassMatrix {
    /// Index in `q` of the joint where the factorisation failed.
    pub index: usize,
}

impl Dynamics {
    /// Forward dynamics: `a_out = M(q)^-1 (tau - C(q, v) v - g(q))` \[rad/s2 or m/s2\].
    ///
    /// Works for every model, mimic joints included, in O(nv^3).
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`]; `a_out` is then unspecified.
    #[expect(clippy::too_many_arguments, reason = "the textbook signature: model, q, v, tau, gravity, a")]
    pub fn forward(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        a_out: &mut [f64],
    ) -> Result<(), SingularMassMatrix> {
        assert_eq!(tau.len(), model.nv(), "length of tau");
        self.bias(model, q, v, gravity, a_out);
        for (a, tau) in a_out.iter_mut().zip(tau) {
            *a = tau - *a;
        }
        // The matrix leaves `self` for the call: an empty one takes its place and nothing is allocated.
        let mut mass = std::mem::replace(&mut self.mass, DMatrix::zeros(0, 0));
        self.crba(model, q, &mut mass);
        let factored = factor(&mut mass);
        if factored.is_ok() {
            solve(&mass, a_out);
        }
        self.mass = mass;
        factored
    }
}

/// Cholesky in place: the lower triangle becomes L of M = L L'. The strict upper triangle is left alone.
fn factor(m: &mut DMatrix<f64>) -> Result<(), SingularMassMatrix> {
    for j in 0..m.nrows() {
        let scale = m[(j, j)];
        let mut pivot = scale;
        for k in 0..j {
            pivot -= m[(j, k)] * m[(j, k)];
        }
        // Cancellation leaves rounding noise where an exact result would be zero.
        if pivot.is_nan() || pivot <= scale * 1e-14 {
            return Err(SingularMassMatrix { index: j });
        }
        let pivot = pivot.sqrt();
        m[(j, j)] = pivot;
        for i in j + 1..m.nrows() {
            let mut entry = m[(i, j)];
            for k in 0..j {
                entry -= m[(i, k)] * m[(j, k)];
            }
            m[(i, j)] = entry / pivot;
        }
    }
    Ok(())
}

/// Solves L L' x = b in place.
fn solve(l: &DMatrix<f64>, x: &mut [f64]) {
    let n = x.len();
    for i in 0..n {
        for k in 0..i {
            x[i] -= l[(i, k)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= l[(k, i)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
}
