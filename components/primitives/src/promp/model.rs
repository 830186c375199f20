//! A Gaussian over movements.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::basis::ProMpBasis;
use super::error::ProMpError;
use crate::ValueError;

/// A probabilistic movement primitive; see the [module](super). Serialises as [`StoredProMp`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredProMp", into = "StoredProMp")]
pub struct ProMp {
    pub(super) basis: ProMpBasis,
    pub(super) dimensions: usize,
    pub(super) mean: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) noise: f64,
    pub(super) duration: f64,
}

/// File format of a [`ProMp`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredProMp {
    /// Basis functions over the phase.
    pub basis: ProMpBasis,
    /// Number of dimensions.
    pub dimensions: usize,
    /// Duration of a demonstration, s.
    pub duration: f64,
    /// Noise of the demonstrations: variance of recorded positions about the movement.
    pub noise: f64,
    /// Mean of the weights, ordered by dimension.
    pub mean: Vec<f64>,
    /// Covariance of the weights, row by row.
    pub covariance: Vec<Vec<f64>>,
}

/// Quantity on which a primitive is conditioned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observed {
    /// Position.
    Position,
    /// Velocity with respect to the phase: the velocity in time multiplied by the duration.
    Velocity,
}

impl ProMp {
    /// Creates a movement of 1 s from the distribution of the weights, with mean (`D N`) and covariance (`D N
    /// x D N`) ordered by dimension.
    ///
    /// # Errors
    /// [`ProMpError`] if sizes do not match, a number is not finite, or the covariance is asymmetric.
    pub fn from_weights(
        basis: ProMpBasis,
        dimensions: usize,
        mean: DVector<f64>,
        covariance: DMatrix<f64>,
    ) -> Result<Self, ProMpError> {
        basis.check()?;
        if dimensions == 0 {
            return Err(ProMpError::Value(ValueError::OutOfRange {
                name: "dimensions",
                value: 0.0,
                expected: "at least 1",
            }));
        }
        let expected = basis.count().saturating_mul(dimensions);
        for (name, found) in [
            ("the mean", mean.len()),
            ("a column of the covariance", covariance.nrows()),
            ("a row of the covariance", covariance.ncols()),
        ] {
            if found != expected {
                return Err(ProMpError::Value(ValueError::Size { name, found, expected }));
            }
        }
        for (name, values) in [("the mean", mean.as_slice()), ("the covariance", covariance.as_slice())] {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ProMpError::Value(ValueError::NotFinite { name, value }));
            }
        }
        if (&covariance - covariance.transpose()).amax() > 1e-9 * covariance.amax() {
            return Err(ProMpError::NotPositive { name: "the covariance, which is not even symmetric," });
        }
        Ok(Self { basis, dimensions, mean, covariance, noise: 0.0, duration: 1.0 })
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Returns the basis functions.
    pub fn basis(&self) -> &ProMpBasis {
        &self.basis
    }

    /// Returns the mean of the weights.
    pub fn weight_mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Returns the covariance of the weights.
    pub fn weight_covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns the noise of the demonstrations, as estimated by the fit: the variance of recorded positions
    /// about the movement. The noise is 0 for a primitive from [`from_weights`](Self::from_weights).
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Returns the duration of the movement, s. Default 1.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Sets the duration of the movement, s.
    ///
    /// # Errors
    /// [`ProMpError`] if the duration is not positive.
    pub fn set_duration(&mut self, duration: f64) -> Result<(), ProMpError> {
        if !(duration > 0.0 && duration.is_finite()) {
            let expected = "a positive time";
            return Err(ProMpError::Value(ValueError::OutOfRange {
                name: "duration",
                value: duration,
                expected,
            }));
        }
        self.duration = duration;
        Ok(())
    }

    /// Returns the mean position at a phase.
    pub fn mean_at(&self, phase: f64) -> DVector<f64> {
        self.project(Observed::Position, phase, &self.mean)
    }

    /// Returns the derivative of the mean position with respect to the phase, at a phase.
    pub fn mean_velocity_at(&self, phase: f64) -> DVector<f64> {
        self.project(Observed::Velocity, phase, &self.mean)
    }

    /// Returns the covariance of the position at a phase, without [`noise`](Self::noise).
    pub fn covariance_at(&self, phase: f64) -> DMatrix<f64> {
        let (_, covariance) = self.observation_model(Observed::Position, phase);
        covariance
    }

    /// Returns the deviation of a position from the mean at a phase in each dimension, in standard
    /// deviations.
    pub fn deviations_from_mean(&self, phase: f64, position: &[f64]) -> Vec<f64> {
        let (mean, covariance) = (self.mean_at(phase), self.covariance_at(phase));
        let distance =
            |(d, place): (usize, &f64)| (place - mean[d]).abs() / covariance[(d, d)].max(0.0).sqrt();
        position.iter().enumerate().take(mean.len()).map(distance).collect()
    }

    /// Returns the position at a phase for these weights.
    pub fn position_of(&self, weights: &DVector<f64>, phase: f64) -> DVector<f64> {
        self.project(Observed::Position, phase, weights)
    }

    /// Returns a sample of the weights. `normal` contains the random numbers from which it is computed: one
    /// independent standard normal number per weight.
    ///
    /// # Errors
    /// [`ProMpError`] if `normal` has the wrong length, or the covariance is no longer positive definite.
    pub fn sample_weights(&self, normal: &DVector<f64>) -> Result<DVector<f64>, ProMpError> {
        if normal.len() != self.mean.len() {
            let (found, expected) = (normal.len(), self.mean.len());
            return Err(ProMpError::Value(ValueError::Size { name: "the normal numbers", found, expected }));
        }
        let mut covariance = self.covariance.clone();
        let jitter = 1e-10 * covariance.trace().abs() / covariance.nrows() as f64;
        (0..covariance.nrows()).for_each(|i| covariance[(i, i)] += jitter);
        let factor =
            covariance.cholesky().ok_or(ProMpError::NotPositive { name: "the covariance of the weights" })?;
        Ok(&self.mean + factor.l() * normal)
    }

    /// Returns the primitive conditioned to pass `place` at `phase` with the covariance `noise` (`D x D`;
    /// zero means exactly): `L = Sigma Phi (noise + Phi^T Sigma Phi)^-1`, `mu + L (place - Phi^T mu)`,
    /// `Sigma - L Phi^T Sigma`.
    ///
    /// # Errors
    /// [`ProMpError`] if sizes do not match, a number is not finite, or the position is already known
    /// exactly.
    pub fn conditioned(
        &self,
        phase: f64,
        place: &DVector<f64>,
        noise: &DMatrix<f64>,
    ) -> Result<Self, ProMpError> {
        self.conditioned_on(Observed::Position, phase, place, noise)
    }

    /// Returns the primitive conditioned so that its position or velocity (`observed`) is `value` at `phase`,
    /// with the covariance `noise`. [`conditioned`](Self::conditioned) is the special case of a position.
    ///
    /// # Errors
    /// [`ProMpError`] in the same cases as [`conditioned`](Self::conditioned).
    pub fn conditioned_on(
        &self,
        observed: Observed,
        phase: f64,
        value: &DVector<f64>,
        noise: &DMatrix<f64>,
    ) -> Result<Self, ProMpError> {
        let expected = self.dimensions;
        for (name, found) in [
            ("the value", value.len()),
            ("a column of the noise", noise.nrows()),
            ("a row of the noise", noise.ncols()),
        ] {
            if found != expected {
                return Err(ProMpError::Value(ValueError::Size { name, found, expected }));
            }
        }
        let numbers = value.iter().chain(noise.iter()).chain([&phase]);
        if let Some(&bad) = numbers.into_iter().find(|value| !value.is_finite()) {
            return Err(ProMpError::Value(ValueError::NotFinite { name: "the condition", value: bad }));
        }
        // Sigma Phi, D N x D, and Phi^T Sigma Phi
        let (carried, mut seen) = self.observation_model(observed, phase);
        // keeps an exact condition solvable; far below the variance of the movement
        let jitter = 1e-8 * seen.trace() / expected as f64;
        seen += noise;
        (0..expected).for_each(|d| seen[(d, d)] += jitter);
        let factor = seen.cholesky().ok_or(ProMpError::NotPositive {
            name: "the covariance of the movement there, together with the noise,",
        })?;
        let gain_transposed = factor.solve(&carried.transpose());
        let missed = value - self.project(observed, phase, &self.mean);
        let mean = &self.mean + gain_transposed.tr_mul(&missed);
        let mut covariance = self.covariance.clone();
        covariance.gemm(-1.0, &carried, &gain_transposed, 1.0);
        symmetrise(&mut covariance);
        Ok(Self { mean, covariance, ..self.clone() })
    }

    /// Returns the basis functions or their slopes at a phase.
    fn functions(&self, observed: Observed, phase: f64) -> DVector<f64> {
        let count = self.basis.count();
        let (mut values, mut slopes) = (DVector::zeros(count), DVector::zeros(count));
        self.basis.evaluate(phase, values.as_mut_slice(), slopes.as_mut_slice());
        match observed {
            Observed::Position => values,
            Observed::Velocity => slopes,
        }
    }

    fn project(&self, observed: Observed, phase: f64, weights: &DVector<f64>) -> DVector<f64> {
        let functions = self.functions(observed, phase);
        let count = functions.len();
        DVector::from_fn(self.dimensions, |d, _| weights.rows(d * count, count).dot(&functions))
    }

    /// `Sigma Phi` and `Phi^T Sigma Phi`.
    fn observation_model(&self, observed: Observed, phase: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let functions = self.functions(observed, phase);
        let (count, dimensions) = (functions.len(), self.dimensions);
        let mut carried = DMatrix::zeros(count * dimensions, dimensions);
        for d in 0..dimensions {
            carried.column_mut(d).gemv(1.0, &self.covariance.columns(d * count, count), &functions, 0.0);
        }
        let seen = DMatrix::from_fn(dimensions, dimensions, |i, j| {
            carried.view((i * count, j), (count, 1)).dot(&functions)
        });
        (carried, seen)
    }
}

/// Symmetrises a matrix that is symmetric up to rounding.
pub(super) fn symmetrise(matrix: &mut DMatrix<f64>) {
    for i in 0..matrix.nrows() {
        for j in 0..i {
            let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
            matrix[(i, j)] = mean;
            matrix[(j, i)] = mean;
        }
    }
}

impl From<ProMp> for StoredProMp {
    fn from(promp: ProMp) -> Self {
        Self {
            basis: promp.basis,
            dimensions: promp.dimensions,
            duration: promp.duration,
            noise: promp.noise,
            mean: promp.mean.as_slice().to_vec(),
            covariance: promp.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        }
    }
}

impl TryFrom<StoredProMp> for ProMp {
    type Error = ProMpError;

    fn try_from(stored: StoredProMp) -> Result<Self, ProMpError> {
        let expected = stored.covariance.len();
        if let Some(row) = stored.covariance.iter().find(|row| row.len() != expected) {
            return Err(ProMpError::Value(ValueError::Size {
                name: "a row of the covariance",
                found: row.len(),
                expected,
            }));
        }
        let covariance = DMatrix::from_fn(expected, expected, |i, j| stored.covariance[i][j]);
        let mean = DVector::from_vec(stored.mean);
        let mut promp = Self::from_weights(stored.basis, stored.dimensions, mean, covariance)?;
        promp.set_duration(stored.duration)?;
        if !(stored.noise >= 0.0 && stored.noise.is_finite()) {
            let expected = "a variance of at least 0";
            return Err(ProMpError::Value(ValueError::OutOfRange {
                name: "noise",
                value: stored.noise,
                expected,
            }));
        }
        promp.noise = stored.noise;
        Ok(promp)
    }
}
