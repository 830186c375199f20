//! A least-squares cost on some of the unknowns.

use motorium_qp::Problem;
use nalgebra::{DMatrix, DVector};

use crate::levels::Rows;

/// The cost `1/2 |W (A x - b)|^2`, with a diagonal `W`, on consecutive unknowns.
///
/// ```
/// use motorium_control::tasks::Cost;
/// use motorium_qp::{Problem, Structure};
///
/// // x_1 + x_2 is to be 3
/// let mut cost = Cost::dense(1, 1, 2);
/// cost.matrix_mut().fill(1.0);
/// cost.desired_mut()[0] = 3.0;
/// let mut problem = Problem::new(&Structure::new(3));
/// cost.add_to(&mut problem);
/// assert_eq!((problem.hessian[(1, 2)], problem.gradient[2]), (1.0, -3.0));
/// assert_eq!(cost.residual(&[0.0, 1.0, 1.5]), 0.5);
/// ```
#[derive(Clone, Debug)]
pub struct Cost {
    /// Index of the first unknown.
    first: usize,
    /// `A`; `None` for the identity.
    matrix: Option<DMatrix<f64>>,
    desired: DVector<f64>,
    weights: DVector<f64>,
}

impl Cost {
    /// Creates a cost with `rows` rows on the `width` unknowns that start at `first`. `A` and `b` are zero;
    /// all weights are 1.
    pub fn dense(rows: usize, first: usize, width: usize) -> Self {
        Self {
            first,
            matrix: Some(DMatrix::zeros(rows, width)),
            desired: DVector::zeros(rows),
            weights: DVector::repeat(rows, 1.0),
        }
    }

    /// Creates a cost on the values of the `count` unknowns that start at `first`. `A` is the identity, `b`
    /// is zero, and all weights are 1.
    pub fn identity(first: usize, count: usize) -> Self {
        Self { first, matrix: None, desired: DVector::zeros(count), weights: DVector::repeat(count, 1.0) }
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.desired.len()
    }

    /// Returns `A`.
    ///
    /// # Panics
    /// If `A` is the identity.
    pub(crate) fn matrix(&self) -> &DMatrix<f64> {
        self.matrix.as_ref().expect("a cost whose matrix is the identity")
    }

    /// Returns `A` for writing.
    ///
    /// # Panics
    /// If `A` is the identity.
    pub fn matrix_mut(&mut self) -> &mut DMatrix<f64> {
        self.matrix.as_mut().expect("a cost whose matrix is the identity")
    }

    /// Returns `b`.
    pub fn desired(&self) -> &DVector<f64> {
        &self.desired
    }

    /// Returns `b` for writing.
    pub fn desired_mut(&mut self) -> &mut DVector<f64> {
        &mut self.desired
    }

    /// Returns the diagonal of `W`.
    pub fn weights(&self) -> &DVector<f64> {
        &self.weights
    }

    /// Returns the diagonal of `W` for writing.
    pub fn weights_mut(&mut self) -> &mut DVector<f64> {
        &mut self.weights
    }

    /// Range of the unknowns in the cost.
    pub(crate) fn columns(&self) -> std::ops::Range<usize> {
        let count = self.matrix.as_ref().map_or(self.rows(), DMatrix::ncols);
        self.first..self.first + count
    }

    /// Writes `A x` for all unknowns `x`.
    pub(crate) fn multiply(&self, x: &DVector<f64>, product: &mut DVector<f64>) {
        let x = x.rows_range(self.columns());
        match &self.matrix {
            None => product.copy_from(&x),
            Some(matrix) => product.gemv(1.0, matrix, &x, 0.0),
        }
    }

    /// Writes `A' y` for all unknowns; unknowns outside the cost get zero.
    pub(crate) fn multiply_transposed(&self, y: &DVector<f64>, product: &mut DVector<f64>) {
        product.fill(0.0);
        let mut own = product.rows_range_mut(self.columns());
        match &self.matrix {
            None => own.copy_from(y),
            Some(matrix) => own.gemv_tr(1.0, matrix, y, 0.0),
        }
    }

    /// `A x - b` of one row.
    fn row(&self, row: usize, x: &[f64]) -> f64 {
        let product = match &self.matrix {
            None => x[self.first + row],
            Some(matrix) => matrix.row(row).iter().zip(&x[self.first..]).map(|(a, x)| a * x).sum(),
        };
        product - self.desired[row]
    }

    /// Returns the norm of `A x - b` over the rows with nonzero weight. `x` contains all unknowns of the
    /// problem.
    pub fn residual(&self, x: &[f64]) -> f64 {
        let counted = (0..self.rows()).filter(|row| self.weights[*row] != 0.0);
        counted.map(|row| self.row(row, x).powi(2)).sum::<f64>().sqrt()
    }

    /// Adds the cost to the gradient and to the upper triangle of the Hessian of `problem`.
    pub fn add_to(&self, problem: &mut Problem) {
        let Some(matrix) = &self.matrix else {
            for (row, (desired, weight)) in self.desired.iter().zip(&self.weights).enumerate() {
                let (variable, squared) = (self.first + row, weight * weight);
                problem.hessian[(variable, variable)] += squared;
                problem.gradient[variable] -= squared * desired;
            }
            return;
        };
        // the usual numbers of rows, without a loop over them
        match matrix.nrows() {
            1 => self.add_rows::<1>(matrix, problem),
            3 => self.add_rows::<3>(matrix, problem),
            6 => self.add_rows::<6>(matrix, problem),
            _ => self.add_blocks(matrix, problem),
        }
    }

    /// Adds a cost of `R` rows.
    fn add_rows<const R: usize>(&self, matrix: &DMatrix<f64>, problem: &mut Problem) {
        let unknowns = problem.hessian.nrows();
        let hessian = problem.hessian.as_mut_slice();
        let (columns, _) = matrix.as_slice().as_chunks::<R>();
        let (weights, desired) = (self.weights.as_slice(), self.desired.as_slice());
        for (j, column) in columns.iter().enumerate() {
            // tasks involve few joints: skip zero columns
            if column.iter().all(|entry| *entry == 0.0) {
                continue;
            }
            let weighted: [f64; R] = std::array::from_fn(|row| column[row] * weights[row] * weights[row]);
            let product = |other: &[f64]| weighted.iter().zip(other).map(|(w, a)| w * a).sum::<f64>();
            problem.gradient[self.first + j] -= product(desired);
            let target = &mut hessian[(self.first + j) * unknowns + self.first..][..=j];
            for (entry, other) in target.iter_mut().zip(columns) {
                *entry += product(other);
            }
        }
    }

    /// Adds a cost of any number of rows.
    fn add_blocks(&self, matrix: &DMatrix<f64>, problem: &mut Problem) {
        let rows = matrix.nrows();
        let unknowns = problem.hessian.nrows();
        let columns = matrix.as_slice();
        let hessian = problem.hessian.as_mut_slice();
        for (j, column) in columns.chunks_exact(rows.max(1)).enumerate() {
            // tasks involve few joints: skip zero columns
            if column.iter().all(|entry| *entry == 0.0) {
                continue;
            }
            let mut weighted = [0.0; Self::BLOCK];
            for first in (0..rows).step_by(Self::BLOCK) {
                let part = first..rows.min(first + Self::BLOCK);
                let weighted = &mut weighted[..part.len()];
                for (out, (entry, weight)) in weighted
                    .iter_mut()
                    .zip(column[part.clone()].iter().zip(&self.weights.as_slice()[part.clone()]))
                {
                    *out = entry * weight * weight;
                }
                let slope: f64 =
                    weighted.iter().zip(&self.desired.as_slice()[part.clone()]).map(|(w, b)| w * b).sum();
                problem.gradient[self.first + j] -= slope;
                let target = &mut hessian[(self.first + j) * unknowns + self.first..][..=j];
                for (entry, other) in target.iter_mut().zip(columns.chunks_exact(rows)) {
                    *entry += weighted.iter().zip(&other[part.clone()]).map(|(w, a)| w * a).sum::<f64>();
                }
            }
        }
    }

    /// Number of rows that are weighted together.
    const BLOCK: usize = 8;

    /// Appends the rows of `W A` and `W b` with nonzero weight.
    pub(crate) fn write_rows(&self, rows: &mut Rows) {
        for (row, weight) in self.weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            let out = rows.push(weight * self.desired[row]);
            match &self.matrix {
                None => out[self.first + row] = *weight,
                Some(matrix) => {
                    let entries = matrix.row(row);
                    for (out, entry) in out[self.first..].iter_mut().zip(entries.iter()) {
                        *out = weight * entry;
                    }
                }
            }
        }
    }
}
