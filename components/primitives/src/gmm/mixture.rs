//! A mixture of Gaussians.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::ValueError;

/// A Gaussian mixture, `p(x) = sum_k pi_k N(x; mu_k, S_k)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Gmm {
    pub(super) weights: Vec<f64>,
    pub(super) means: Vec<DVector<f64>>,
    pub(super) covariances: Vec<DMatrix<f64>>,
}

/// Error returned when a mixture cannot be created or evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GmmError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// There are too few samples for the number of components.
    #[error("found {samples} samples, expected at least one for each of {components} components")]
    TooFew {
        /// Number of samples found.
        samples: usize,
        /// Requested number of components.
        components: usize,
    },
    /// A sample is not finite.
    #[error("sample {sample} contains {value}, expected only finite numbers")]
    NotFinite {
        /// Index of the sample, from 0.
        sample: usize,
        /// Value found.
        value: f64,
    },
    /// A covariance is not positive definite.
    #[error("the covariance of component {component} is not positive definite: raise the floor")]
    NotPositive {
        /// Index of the component, from 0.
        component: usize,
    },
}

impl Gmm {
    /// Creates a mixture from weights, means and covariances. The weights are normalised to sum to 1.
    ///
    /// # Errors
    /// [`GmmError`] if sizes do not match, a weight is not positive, or a covariance is not positive
    /// definite.
    pub fn new(
        mut weights: Vec<f64>,
        means: Vec<DVector<f64>>,
        covariances: Vec<DMatrix<f64>>,
    ) -> Result<Self, GmmError> {
        let components = weights.len();
        if components == 0 {
            return Err(GmmError::Value(ValueError::OutOfRange {
                name: "components",
                value: 0.0,
                expected: "at least 1",
            }));
        }
        for (name, found) in [("means", means.len()), ("covariances", covariances.len())] {
            if found != components {
                return Err(GmmError::Value(ValueError::Size { name, found, expected: components }));
            }
        }
        let expected = means[0].len();
        for (component, (mean, covariance)) in means.iter().zip(&covariances).enumerate() {
            for (name, found) in [
                ("a mean", mean.len()),
                ("a column of a covariance", covariance.nrows()),
                ("a row of a covariance", covariance.ncols()),
            ] {
                if found != expected {
                    return Err(GmmError::Value(ValueError::Size { name, found, expected }));
                }
            }
            let finite = mean.iter().chain(covariance.iter()).all(|value| value.is_finite());
            if !finite || covariance.clone().cholesky().is_none() {
                return Err(GmmError::NotPositive { component });
            }
        }
        if let Some(&value) = weights.iter().find(|weight| !(**weight > 0.0 && weight.is_finite())) {
            return Err(GmmError::Value(ValueError::OutOfRange {
                name: "a weight",
                value,
                expected: "a positive number",
            }));
        }
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        Ok(Self { weights, means, covariances })
    }

    /// Returns the number of components.
    pub fn components(&self) -> usize {
        self.weights.len()
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.means[0].len()
    }

    /// Returns the weights `pi_k`.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns the means `mu_k`.
    pub fn means(&self) -> &[DVector<f64>] {
        &self.means
    }

    /// Returns the covariances `S_k`.
    pub fn covariances(&self) -> &[DMatrix<f64>] {
        &self.covariances
    }

    /// Returns the log-likelihood, summed over the samples (each a row).
    ///
    /// # Errors
    /// [`GmmError`] if the dimension of the samples differs from the mixture's, or a covariance is no longer
    /// positive definite.
    pub fn log_likelihood(&self, samples: &DMatrix<f64>) -> Result<f64, GmmError> {
        let mut joint = DMatrix::zeros(samples.nrows(), self.components());
        self.log_joint(samples, &mut joint)?;
        Ok(joint.row_iter().map(|row| log_sum(row.iter().copied())).sum())
    }

    /// Returns the Bayesian information criterion, `-2 log L + k ln n` with `k` free parameters. Smaller is
    /// better.
    ///
    /// # Errors
    /// [`GmmError`] in the same cases as [`log_likelihood`](Self::log_likelihood).
    pub fn bic(&self, samples: &DMatrix<f64>) -> Result<f64, GmmError> {
        let (k, d) = (self.components() as f64, self.dimensions() as f64);
        let free = k * d * (d + 1.0) / 2.0 + k * d + k - 1.0;
        Ok(free * (samples.nrows() as f64).ln() - 2.0 * self.log_likelihood(samples)?)
    }

    /// Writes `ln(pi_k N(x_n; mu_k, S_k))`, samples x components.
    pub(super) fn log_joint(&self, samples: &DMatrix<f64>, joint: &mut DMatrix<f64>) -> Result<(), GmmError> {
        if samples.ncols() != self.dimensions() {
            let (found, expected) = (samples.ncols(), self.dimensions());
            return Err(GmmError::Value(ValueError::Size { name: "a sample", found, expected }));
        }
        let transposed = samples.transpose();
        for component in 0..self.components() {
            let factor = self.factor(component)?;
            let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
            let constant =
                self.weights[component].ln() - log_determinant - 0.5 * self.dimensions() as f64 * TAU.ln();
            let mut whitened = transposed.clone();
            whitened.column_iter_mut().for_each(|mut column| column -= &self.means[component]);
            factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
            for (n, column) in whitened.column_iter().enumerate() {
                joint[(n, component)] = constant - 0.5 * column.norm_squared();
            }
        }
        Ok(())
    }

    pub(super) fn factor(&self, component: usize) -> Result<Cholesky<f64, Dyn>, GmmError> {
        self.covariances[component].clone().cholesky().ok_or(GmmError::NotPositive { component })
    }
}

/// `ln(sum(exp(x)))` without overflow.
pub(super) fn log_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    largest + values.map(|value| (value - largest).exp()).sum::<f64>().ln()
}
