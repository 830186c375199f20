//! Equations of tasks.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::impedance::Impedance;
use super::response::Response;
use crate::cost::Cost;

/// Equation of a task at a robot state, and the cost that a formulation derives from the equation.
#[derive(Clone, Debug)]
pub struct Equation {
    /// Error `e`, one entry per row; zero for a task without a position.
    pub error: DVector<f64>,
    /// Rate of the target, `nu`, so that `e' = nu - J v`.
    pub rate: DVector<f64>,
    /// Time derivative of `nu`.
    pub rate_derivative: DVector<f64>,
    /// Rate of the error, `e'`, at the robot's velocity.
    pub error_rate: DVector<f64>,
    /// Drift `J' v`, the part of `(J v)'` that does not depend on the acceleration.
    pub drift: DVector<f64>,
    /// Requested response to the error.
    pub response: Response,
    /// Selection matrices `S` of rows 0 to 2 and rows 3 to 5. They apply to the error `e` and its rate, but
    /// not to `J`, `nu`, `nu'` and `J' v`: a formulation requests `S e`. Default: the identity.
    pub selection: Option<[Matrix3<f64>; 2]>,
    pub(super) cost: Cost,
    /// `gain e`, limited to the largest speeds.
    pub(super) correction: DVector<f64>,
    /// Levenberg-Marquardt damping of the last update.
    pub(super) damping: f64,
    pub(super) impedance: Option<Impedance>,
}

impl Equation {
    /// Creates an equation of `rows` rows on the `width` velocities that start at `first`. `J` and the right
    /// side are zero; all weights are 1.
    pub fn dense(rows: usize, first: usize, width: usize) -> Self {
        Self::new(Cost::dense(rows, first, width))
    }

    /// Creates an equation on the `count` velocities that start at `first`. `J` is the identity, the right
    /// side is zero, and all weights are 1.
    pub fn identity(first: usize, count: usize) -> Self {
        Self::new(Cost::identity(first, count))
    }

    fn new(cost: Cost) -> Self {
        let zero = DVector::zeros(cost.rows());
        Self {
            error: zero.clone(),
            rate: zero.clone(),
            rate_derivative: zero.clone(),
            error_rate: zero.clone(),
            drift: zero.clone(),
            response: Response::decay(0.0),
            selection: None,
            cost,
            correction: zero,
            damping: 0.0,
            impedance: None,
        }
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.error.len()
    }

    /// Returns `J` for writing.
    ///
    /// # Panics
    /// If `J` is the identity.
    pub fn jacobian_mut(&mut self) -> &mut DMatrix<f64> {
        self.cost.matrix_mut()
    }

    /// Returns `J` of the last evaluation.
    ///
    /// # Panics
    /// If `J` is the identity.
    pub fn jacobian(&self) -> &DMatrix<f64> {
        self.cost.matrix()
    }

    /// Returns the diagonal of `W` for writing.
    pub fn weights_mut(&mut self) -> &mut DVector<f64> {
        self.cost.weights_mut()
    }

    /// Replaces `correction` by `S correction` or, if `transposed`, by `S' correction`.
    pub(super) fn select(&mut self, transposed: bool) {
        let Some(factors) = &self.selection else { return };
        for (block, factor) in factors.iter().enumerate() {
            let mut rows = self.correction.fixed_rows_mut::<3>(3 * block);
            let selected = if transposed { factor.tr_mul(&rows) } else { factor * &rows };
            rows.copy_from(&selected);
        }
    }

    /// Returns the cost of the last update by a formulation.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}
