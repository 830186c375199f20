//! Forward dynamics of a robot under constraints, such as contacts.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{Dynamics, SingularMassMatrix};
use crate::Model;

/// Error of computing a constrained motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConstrainedError {
    /// The mass matrix is singular.
    #[error(transparent)]
    Mass(#[from] SingularMassMatrix),
    /// A row of the constraint is a linear combination of the rows before it.
    #[error(
        "row {row} of the constraint depends linearly on the rows before it; remove it, or regularise with a damping above 0"
    )]
    Redundant {
        /// Index of the row in the constraint's Jacobian.
        row: usize,
    },
}

/// Workspace for the forward dynamics of one [`Model`] under a fixed number of constraints. Only
/// [`new`](Self::new) allocates.
///
/// By Gauss's principle, the constrained acceleration `a` satisfies `J a + drift = 0` and is as close as
/// possible to the unconstrained acceleration `a_free` in the metric of M:
///
/// ```text
/// M a = tau - C v - g + J' lambda        (J M^-1 J' + damping 1) lambda = -(J a_free + drift)
/// ```
#[derive(Clone, Debug)]
pub struct ConstrainedDynamics {
    dynamics: Dynamics,
    /// Rows of J M^-1, stored like J'.
    reduced: DMatrix<f64>,
    /// J M^-1 J', then its Cholesky factor.
    delassus: DMatrix<f64>,
    bias: DVector<f64>,
}

/// A constraint `jacobian * a + drift = 0` on the acceleration `a`.
#[derive(Clone, Copy, Debug)]
pub struct Constraint<'a> {
    /// Jacobian of the constraint: one row per constrained direction, nv columns.
    pub jacobian: &'a DMatrix<f64>,
    /// Drift `Jdot v` of each row, plus a correction of position errors if desired.
    pub drift: &'a [f64],
    /// Damping added to the diagonal of `J M^-1 J'` \[1/kg\], which makes the constraint compliant. With 0,
    /// the constraint is rigid and its rows must be linearly independent.
    pub damping: f64,
}

impl ConstrainedDynamics {
    /// Creates a workspace for `model` under constraints with exactly `rows` rows (constrained directions) in
    /// total.
    pub fn new(model: &Model, rows: usize) -> Self {
        Self {
            dynamics: Dynamics::new(model),
            reduced: DMatrix::zeros(rows, model.nv()),
            delassus: DMatrix::zeros(rows, rows),
            bias: DVector::zeros(model.nv()),
        }
    }

    /// Computes the acceleration `a_out` (nv) and the constraint forces `lambda_out`, one per row. A force is
    /// positive along its row of the Jacobian.
    ///
    /// # Errors
    ///
    /// [`ConstrainedError`]. In this case the outputs are unspecified.
    pub fn forward(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        constraint: Constraint<'_>,
        a_out: &mut [f64],
        lambda_out: &mut [f64],
    ) -> Result<(), ConstrainedError> {
        let rows = self.delassus.nrows();
        let Constraint { jacobian, drift, damping } = constraint;
        assert_eq!(jacobian.shape(), (rows, model.nv()), "shape of the constraint's Jacobian");
        assert!(drift.len() == rows && lambda_out.len() == rows, "length of drift and lambda");
        assert_eq!(a_out.len(), model.nv(), "length of a");
        self.dynamics.bias(model, q, v, gravity, self.bias.as_mut_slice());
        for ((a, tau), bias) in a_out.iter_mut().zip(tau).zip(&self.bias) {
            *a = tau - bias;
        }
        let factor = self.dynamics.factor_mass(model, q)?;
        factor.solve(a_out);
        self.reduced.copy_from(jacobian);
        factor.solve_right(&mut self.reduced);
        for i in 0..rows {
            for j in 0..=i {
                self.delassus[(i, j)] = self.reduced.row(i).dot(&jacobian.row(j));
            }
            self.delassus[(i, i)] += damping;
            lambda_out[i] =
                -drift[i] - jacobian.row(i).iter().zip(a_out.iter()).map(|(j, a)| j * a).sum::<f64>();
        }
        self.solve(lambda_out)?;
        for (column, a) in a_out.iter_mut().enumerate() {
            *a += self.reduced.column(column).iter().zip(lambda_out.iter()).map(|(r, l)| r * l).sum::<f64>();
        }
        Ok(())
    }

    /// Factorises the small matrix and solves for the forces.
    fn solve(&mut self, x: &mut [f64]) -> Result<(), ConstrainedError> {
        let l = &mut self.delassus;
        for j in 0..x.len() {
            let scale = l[(j, j)];
            let pivot = scale - (0..j).map(|k| l[(j, k)] * l[(j, k)]).sum::<f64>();
            // Cancellation leaves rounding noise instead of an exact zero.
            if pivot.is_nan() || pivot <= scale * 1e-12 {
                return Err(ConstrainedError::Redundant { row: j });
            }
            l[(j, j)] = pivot.sqrt();
            for i in j + 1..x.len() {
                let entry = l[(i, j)] - (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum::<f64>();
                l[(i, j)] = entry / l[(j, j)];
            }
        }
        for i in 0..x.len() {
            x[i] = (x[i] - (0..i).map(|k| l[(i, k)] * x[k]).sum::<f64>()) / l[(i, i)];
        }
        for i in (0..x.len()).rev() {
            x[i] = (x[i] - (i + 1..x.len()).map(|k| l[(k, i)] * x[k]).sum::<f64>()) / l[(i, i)];
        }
        Ok(())
    }
}
