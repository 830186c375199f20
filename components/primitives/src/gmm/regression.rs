//! Gaussian mixture regression, which predicts some coordinates of a mixture from the remaining coordinates.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::mixture::{Gmm, GmmError};
use crate::ValueError;

/// Gaussian mixture regression: the distribution of the remaining coordinates, given the first `inputs`
/// coordinates.
///
/// `h_k(x) = pi_k N(x; mu_k^x, S_k^xx) / sum`, `m_k(x) = mu_k^y + S_k^yx (S_k^xx)^-1 (x - mu_k^x)`, `S_k =
/// S_k^yy - S_k^yx (S_k^xx)^-1 S_k^xy`; mean `m = sum h_k m_k`, covariance `sum h_k (S_k + m_k m_k^T) - m
/// m^T`.
///
/// Everything that does not depend on `x` is prepared by [`new`](Self::new); [`predict`](Self::predict) does
/// not allocate.
#[derive(Clone, Debug)]
pub struct Gmr {
    inputs: usize,
    components: Vec<Conditional>,
    shares: Vec<f64>,
    offset: DVector<f64>,
    whitened: DVector<f64>,
    means: Vec<DVector<f64>>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

#[derive(Clone, Debug)]
struct Conditional {
    constant: f64,
    input: DVector<f64>,
    output: DVector<f64>,
    /// Lower Cholesky factor of `S^xx`.
    factor: DMatrix<f64>,
    /// `S^yx (S^xx)^-1`.
    gain: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

impl Gmr {
    /// Prepares the regression for a mixture whose first `inputs` coordinates are the inputs.
    ///
    /// # Errors
    /// [`GmmError`] if there is no input or no output, or an input covariance is not positive definite.
    pub fn new(gmm: &Gmm, inputs: usize) -> Result<Self, GmmError> {
        let dimensions = gmm.dimensions();
        if inputs == 0 || inputs >= dimensions {
            let (name, value) = ("inputs", inputs as f64);
            return Err(GmmError::Value(ValueError::OutOfRange {
                name,
                value,
                expected: "at least 1 and fewer than the number of coordinates",
            }));
        }
        let outputs = dimensions - inputs;
        let mut components = Vec::new();
        for k in 0..gmm.components() {
            let (mean, covariance) = (&gmm.means()[k], &gmm.covariances()[k]);
            let xx = covariance.view((0, 0), (inputs, inputs)).into_owned();
            let xy = covariance.view((0, inputs), (inputs, outputs)).into_owned();
            let yy = covariance.view((inputs, inputs), (outputs, outputs)).into_owned();
            let factor = xx.cholesky().ok_or(GmmError::NotPositive { component: k })?;
            let gain = factor.solve(&xy).transpose();
            let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
            components.push(Conditional {
                constant: gmm.weights()[k].ln() - log_determinant - 0.5 * inputs as f64 * TAU.ln(),
                input: mean.rows(0, inputs).into_owned(),
                output: mean.rows(inputs, outputs).into_owned(),
                covariance: yy - &gain * &xy,
                factor: factor.l(),
                gain,
            });
        }
        Ok(Self {
            inputs,
            shares: vec![0.0; components.len()],
            offset: DVector::zeros(inputs),
            whitened: DVector::zeros(inputs),
            means: vec![DVector::zeros(outputs); components.len()],
            mean: DVector::zeros(outputs),
            covariance: DMatrix::zeros(outputs, outputs),
            components,
        })
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Returns the mean and covariance of the outputs for an input. Far from all components, the nearest
    /// component dominates.
    ///
    /// # Errors
    /// [`GmmError`] if the input has the wrong length or is not finite.
    pub fn predict(&mut self, input: &[f64]) -> Result<(&DVector<f64>, &DMatrix<f64>), GmmError> {
        if input.len() != self.inputs {
            return Err(GmmError::Value(ValueError::Size {
                name: "the input",
                found: input.len(),
                expected: self.inputs,
            }));
        }
        if let Some(&value) = input.iter().find(|value| !value.is_finite()) {
            return Err(GmmError::NotFinite { sample: 0, value });
        }
        let mut largest = f64::NEG_INFINITY;
        for (k, component) in self.components.iter().enumerate() {
            for (i, value) in input.iter().enumerate() {
                self.offset[i] = value - component.input[i];
            }
            self.whitened.copy_from(&self.offset);
            component.factor.solve_lower_triangular_mut(&mut self.whitened);
            self.shares[k] = component.constant - 0.5 * self.whitened.norm_squared();
            largest = largest.max(self.shares[k]);
            self.means[k].copy_from(&component.output);
            self.means[k].gemv(1.0, &component.gain, &self.offset, 1.0);
        }
        let mut sum = 0.0;
        for share in &mut self.shares {
            *share = (*share - largest).exp();
            sum += *share;
        }
        self.mean.fill(0.0);
        self.covariance.fill(0.0);
        for (k, component) in self.components.iter().enumerate() {
            let share = self.shares[k] / sum;
            self.mean.axpy(share, &self.means[k], 1.0);
            self.covariance.zip_apply(&component.covariance, |all, one| *all += share * one);
            self.covariance.ger(share, &self.means[k], &self.means[k], 1.0);
        }
        self.covariance.ger(-1.0, &self.mean, &self.mean, 1.0);
        Ok((&self.mean, &self.covariance))
    }
}
