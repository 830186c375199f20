//! Recursive principal components from the covariance.

use nalgebra::{DMatrix, DVector};

use motorium_algebra::{SymmetricEigen, symmetric_eigen};

/// Recursive mean and scatter matrix of samples.
///
/// With `N` samples of mean `m` and scatter `S = sum (x - m)(x - m)^T`, one more sample `x` yields
///
/// ```text
/// m' = (N m + x) / (N + 1),    S' = S + N / (N + 1) (x - m)(x - m)^T
/// ```
///
/// The result is exact and needs `O(d^2)` memory; principal components cost `O(d^3)`.
/// [`RecursiveLibrary`](super::RecursiveLibrary) is cheaper.
#[derive(Clone, Debug)]
pub struct RecursiveScatter {
    samples: usize,
    mean: DVector<f64>,
    scatter: DMatrix<f64>,
}

impl RecursiveScatter {
    /// Creates an empty scatter for samples with `dimensions` entries.
    pub fn new(dimensions: usize) -> Self {
        Self { samples: 0, mean: DVector::zeros(dimensions), scatter: DMatrix::zeros(dimensions, dimensions) }
    }

    /// Adds a sample.
    ///
    /// # Panics
    /// If the length of the sample differs from the number of dimensions.
    pub fn add(&mut self, sample: &DVector<f64>) {
        let n = self.samples as f64;
        let away = sample - &self.mean;
        self.scatter.ger(n / (n + 1.0), &away, &away, 1.0);
        self.mean += away / (n + 1.0);
        self.samples += 1;
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Returns the mean of the samples.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Returns the covariance, `S / (N - 1)`.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.scatter / (self.samples.max(2) - 1) as f64
    }

    /// Returns the principal components: variances in descending order, and directions.
    pub fn components(&self) -> SymmetricEigen {
        symmetric_eigen(self.covariance())
    }
}
