//! A movement whose dimensions are polynomials of the phase.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{PolynomialPolicy, RegressionError};
use crate::ValueError;
use crate::mean::MeanMovement;

/// A movement whose dimensions are polynomials of the phase `p` (0 at the start, 1 at the end): `y(p) = sum_k
/// w_k p^k`.
///
/// ```
/// use motorium_primitives::regression::PolynomialMovement;
/// use nalgebra::DMatrix;
///
/// let shown = DMatrix::from_fn(50, 1, |k, _| 1.0 + 2.0 * (k as f64 / 49.0).powi(2));
/// let movement = PolynomialMovement::fit(&[shown], 1.5, 2, 0.0)?;
/// assert!((movement.position(0.5)[0] - 1.5).abs() < 1e-9);
/// # Ok::<(), motorium_primitives::regression::RegressionError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredPolynomial", into = "StoredPolynomial")]
pub struct PolynomialMovement {
    duration: f64,
    /// Powers from 0 on x dimensions.
    weights: DMatrix<f64>,
}

/// File format of a [`PolynomialMovement`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredPolynomial {
    /// Duration of the movement, s.
    pub duration: f64,
    /// Weight of each power of the phase, starting with power 0, for each dimension.
    pub weights: Vec<Vec<f64>>,
}

impl PolynomialMovement {
    /// Fits polynomials of a degree to evenly spaced demonstrations (each samples x dimensions) whose mean
    /// duration is `duration` seconds. The penalty `lambda |w|^2` applies to all weights except the
    /// constants.
    ///
    /// # Errors
    /// [`RegressionError`] in the same cases as [`PolynomialPolicy::fit`], and if the duration is not
    /// positive.
    pub fn fit(
        demonstrations: &[DMatrix<f64>],
        duration: f64,
        degree: usize,
        lambda: f64,
    ) -> Result<Self, RegressionError> {
        let (rows, columns) = (
            demonstrations.iter().map(DMatrix::nrows).sum(),
            demonstrations.first().map_or(0, DMatrix::ncols),
        );
        let (mut phases, mut positions) = (DMatrix::zeros(rows, 1), DMatrix::zeros(rows, columns));
        let mut row = 0;
        for shown in demonstrations {
            if shown.ncols() != columns {
                let (name, found) = ("a demonstration", shown.ncols());
                return Err(RegressionError::Value(ValueError::Size { name, found, expected: columns }));
            }
            for k in 0..shown.nrows() {
                phases[(row, 0)] = k as f64 / (shown.nrows() - 1).max(1) as f64;
                positions.row_mut(row).copy_from(&shown.row(k));
                row += 1;
            }
        }
        let policy = PolynomialPolicy::fit(&phases, &positions, degree, lambda)?;
        Self::from_weights(policy.weights().clone(), duration)
    }

    fn from_weights(weights: DMatrix<f64>, duration: f64) -> Result<Self, RegressionError> {
        let refuse = |name, value, expected| {
            Err(RegressionError::Value(ValueError::OutOfRange { name, value, expected }))
        };
        if !(duration > 0.0 && duration.is_finite()) {
            return refuse("duration", duration, "a positive time");
        }
        if weights.is_empty() {
            return refuse("the number of weights", 0.0, "at least 1 for each of at least 1 dimension");
        }
        if let Some(&value) = weights.iter().find(|value| !value.is_finite()) {
            return Err(RegressionError::Value(ValueError::NotFinite { name: "weights", value }));
        }
        Ok(Self { duration, weights })
    }

    /// Returns the degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.weights.nrows() - 1
    }

    /// Returns the weights, powers x dimensions.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// Returns the position at a phase.
    pub fn position(&self, phase: f64) -> Vec<f64> {
        self.weights.column_iter().map(|weights| value(weights.as_slice(), phase).0).collect()
    }

    /// Returns the derivative of the position with respect to the phase.
    pub fn slope(&self, phase: f64) -> Vec<f64> {
        self.weights.column_iter().map(|weights| value(weights.as_slice(), phase).1).collect()
    }
}

impl MeanMovement for PolynomialMovement {
    fn dimensions(&self) -> usize {
        self.weights.ncols()
    }

    fn duration(&self) -> f64 {
        self.duration
    }

    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]) {
        for (d, weights) in self.weights.as_slice().chunks_exact(self.weights.nrows()).enumerate() {
            (position[d], slope[d]) = value(weights, phase);
        }
    }
}

/// Evaluates a polynomial and its derivative by Horner's rule.
fn value(weights: &[f64], phase: f64) -> (f64, f64) {
    weights
        .iter()
        .rev()
        .fold((0.0, 0.0), |(value, slope), weight| (value * phase + weight, slope * phase + value))
}

impl From<PolynomialMovement> for StoredPolynomial {
    fn from(movement: PolynomialMovement) -> Self {
        let weights = movement.weights.column_iter().map(|column| column.iter().copied().collect()).collect();
        Self { duration: movement.duration, weights }
    }
}

impl TryFrom<StoredPolynomial> for PolynomialMovement {
    type Error = RegressionError;

    fn try_from(stored: StoredPolynomial) -> Result<Self, RegressionError> {
        let powers = stored.weights.first().map_or(0, Vec::len);
        if let Some(column) = stored.weights.iter().find(|column| column.len() != powers) {
            let (name, found) = ("a dimension of weights", column.len());
            return Err(RegressionError::Value(ValueError::Size { name, found, expected: powers }));
        }
        let count = stored.weights.len();
        let weights = DMatrix::from_iterator(powers, count, stored.weights.into_iter().flatten());
        Self::from_weights(weights, stored.duration)
    }
}
