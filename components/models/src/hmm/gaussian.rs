//! Gaussian observations.

use motorium_algebra::Cholesky;

/// Form of the covariance matrices of observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Diagonal covariances: the columns are independent.
    Diagonal,
    /// Full covariances: the columns may be correlated.
    Full,
}

/// Gaussian observation model of a state.
#[derive(Clone, Debug)]
pub(super) struct Gaussian {
    pub(super) mean: Vec<f64>,
    /// Covariance, row by row.
    pub(super) covariance: Vec<f64>,
    factor: Cholesky,
    constant: f64,
}

impl Gaussian {
    /// Creates the model; `None` if the covariance is not positive definite.
    pub(super) fn new(mean: &[f64], covariance: &[f64]) -> Option<Self> {
        let d = mean.len();
        let mut factor = Cholesky::with_capacity(d);
        let fill = |i: usize, out: &mut [f64]| out.copy_from_slice(&covariance[i * d + i..(i + 1) * d]);
        factor.factorise(d, fill).ok()?;
        let constant = -0.5 * (d as f64 * (2.0 * std::f64::consts::PI).ln() + factor.log_determinant());
        Some(Self { mean: mean.to_vec(), covariance: covariance.to_vec(), factor, constant })
    }

    pub(super) fn log_density(&self, y: &[f64], scratch: &mut [f64]) -> f64 {
        scratch.iter_mut().zip(y).zip(&self.mean).for_each(|((out, y), m)| *out = y - m);
        self.factor.solve_lower(scratch);
        self.constant - 0.5 * scratch.iter().map(|v| v * v).sum::<f64>()
    }
}

/// Returns the mean and covariance of rows.
pub(super) fn moments(rows: &[f64], d: usize) -> (Vec<f64>, Vec<f64>) {
    let n = (rows.len() / d) as f64;
    let mut mean = vec![0.0; d];
    for row in rows.chunks_exact(d) {
        mean.iter_mut().zip(row).for_each(|(m, y)| *m += y / n);
    }
    let mut covariance = vec![0.0; d * d];
    for row in rows.chunks_exact(d) {
        for i in 0..d {
            for j in 0..d {
                covariance[i * d + j] += (row[i] - mean[i]) * (row[j] - mean[j]) / n;
            }
        }
    }
    (mean, covariance)
}

/// Drops the off-diagonal entries for a diagonal shape and raises the variances by a floor.
pub(super) fn restrict(covariance: &mut [f64], d: usize, shape: Shape, floor: f64) {
    for (i, value) in covariance.iter_mut().enumerate() {
        if i / d == i % d {
            *value += floor;
        } else if shape == Shape::Diagonal {
            *value = 0.0;
        }
    }
}
