//! Model of a rhythmic primitive.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ValueError;
use crate::dmp::settings::ModelError;
use crate::dmp::spring::CriticalSpring;

/// Settings of a rhythmic primitive. [`Default`] returns the values documented on each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RhythmicSettings {
    /// Number of kernels around the cycle for each dimension, at least 3. Default 30.
    pub kernels: usize,
    /// Damping `D` of the transformation system; its stiffness is `K = D^2 / 4`, critically damped. Default
    /// 25.
    pub damping: f64,
    /// Width parameter `h` of the kernels. Default: equal to the number of kernels.
    pub width: Option<f64>,
}

impl Default for RhythmicSettings {
    fn default() -> Self {
        Self { kernels: 30, damping: 25.0, width: None }
    }
}

/// A learned rhythmic primitive. The model does not change at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredRhythmicModel", into = "StoredRhythmicModel")]
pub struct RhythmicModel {
    pub(super) settings: RhythmicSettings,
    /// Kernels x dimensions.
    pub(super) weights: DMatrix<f64>,
    pub(super) baseline: DVector<f64>,
}

/// File format of a [`RhythmicModel`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredRhythmicModel {
    /// Settings of the primitive.
    pub settings: RhythmicSettings,
    /// Centre of the oscillation of each dimension.
    pub baseline: Vec<f64>,
    /// Weight of each kernel, for each dimension.
    pub weights: Vec<Vec<f64>>,
}

/// Error returned when a rhythmic primitive cannot be fitted to periods.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PeriodError {
    /// A period has too few samples.
    #[error(
        "found {found} samples in one period, expected at least 4 and at least one for each of the {kernels} kernels"
    )]
    TooShort {
        /// Number of samples found.
        found: usize,
        /// Number of kernels.
        kernels: usize,
    },
    /// The samples have no dimensions.
    #[error("the samples have no dimension, expected at least one")]
    NoDimension,
    /// Periods differ in their number of dimensions.
    #[error("period {index} has {found} dimensions, expected {expected} as in the first period")]
    Dimensions {
        /// Index of the period, from 0.
        index: usize,
        /// Number of dimensions found.
        found: usize,
        /// Number of dimensions of the first period.
        expected: usize,
    },
    /// A sample is not finite.
    #[error("a sample is {value}, expected a finite number: cut the recording or fill the gap")]
    NotFinite {
        /// Value found.
        value: f64,
    },
    /// The settings are invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl RhythmicModel {
    /// Creates a model from weights (kernels x dimensions) and the baseline of each dimension.
    ///
    /// # Errors
    /// [`ModelError`] if a setting is out of range, sizes do not match, or a number is not finite.
    pub fn with_weights(
        settings: RhythmicSettings,
        weights: DMatrix<f64>,
        baseline: DVector<f64>,
    ) -> Result<Self, ModelError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let width = settings.width.unwrap_or(1.0);
        for (name, value, holds, expected) in [
            ("kernels", settings.kernels as f64, settings.kernels >= 3, "at least 3"),
            ("damping", settings.damping, positive(settings.damping), "a positive number"),
            ("width", width, positive(width), "a positive number"),
            ("dimensions", weights.ncols() as f64, weights.ncols() > 0, "at least 1"),
        ] {
            if !holds {
                return Err(ModelError::Value(ValueError::OutOfRange { name, value, expected }));
            }
        }
        if weights.nrows() != settings.kernels {
            let (found, expected) = (weights.nrows(), settings.kernels);
            return Err(ModelError::Value(ValueError::Size { name: "a column of weights", found, expected }));
        }
        if baseline.len() != weights.ncols() {
            let (found, expected) = (baseline.len(), weights.ncols());
            return Err(ModelError::Value(ValueError::Size { name: "baseline", found, expected }));
        }
        for (name, values) in [("weights", weights.as_slice()), ("baseline", baseline.as_slice())] {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ModelError::Value(ValueError::NotFinite { name, value }));
            }
        }
        Ok(Self { settings, weights, baseline })
    }

    /// Fits a primitive to one or more periods by ridge regression with the penalty `lambda >= 0`.
    ///
    /// Each period is a matrix (samples x dimensions) of evenly spaced samples that starts at phase 0. The
    /// closing sample, which belongs to the next period, is omitted. Derivatives are central differences
    /// around the cycle. The baseline is the middle of the range. The weights refer to normalised time and do
    /// not depend on the duration of the period.
    ///
    /// # Errors
    /// [`PeriodError`] if there are too few samples, the dimensions differ, a number is not finite, or a
    /// setting is out of range.
    pub fn fit(
        settings: RhythmicSettings,
        periods: &[DMatrix<f64>],
        lambda: f64,
    ) -> Result<Self, PeriodError> {
        if !(lambda.is_finite() && lambda >= 0.0) {
            let expected = "a finite number of at least 0";
            return Err(ModelError::Value(ValueError::OutOfRange {
                name: "lambda",
                value: lambda,
                expected,
            })
            .into());
        }
        let mut model = Self::unlearned(settings, periods)?;
        let kernels = model.settings.kernels;
        let (features, mut right) = model.regression(periods);
        let samples = features.nrows();
        let mut left = features.resize_vertically(samples + kernels, 0.0);
        right.resize_vertically_mut(samples + kernels, 0.0);
        left.rows_mut(samples, kernels).fill_diagonal(lambda.sqrt());
        let factored = left.qr();
        factored.q_tr_mul(&mut right);
        let solution = right.rows(0, kernels).into_owned();
        model.weights = factored
            .r()
            .solve_upper_triangular(&solution)
            .filter(|weights| weights.iter().all(|weight| weight.is_finite()))
            .ok_or(PeriodError::TooShort { found: samples, kernels })?;
        Ok(model)
    }

    /// Fits each kernel separately: `w_i = sum psi_i f / sum psi_i` over the samples, with the forcing term
    /// `f` (Ijspeert et al. 2013). For the same number of kernels, this is less accurate than
    /// [`fit`](Self::fit).
    ///
    /// # Errors
    /// [`PeriodError`] in the same cases as [`fit`](Self::fit).
    pub fn fit_locally_weighted(
        settings: RhythmicSettings,
        periods: &[DMatrix<f64>],
    ) -> Result<Self, PeriodError> {
        let mut model = Self::unlearned(settings, periods)?;
        let (mut features, targets) = model.regression(periods);
        let width = model.settings.width.unwrap_or(model.settings.kernels as f64);
        let mut row = 0;
        for period in periods {
            for k in 0..period.nrows() {
                let phase = std::f64::consts::TAU * k as f64 / period.nrows() as f64;
                for i in 0..features.ncols() {
                    let centre = std::f64::consts::TAU * i as f64 / features.ncols() as f64;
                    features[(row, i)] = (width * ((phase - centre).cos() - 1.0)).exp();
                }
                row += 1;
            }
        }
        let weighted = features.tr_mul(&targets);
        let sums = features.row_sum();
        model.weights =
            DMatrix::from_fn(weighted.nrows(), weighted.ncols(), |i, d| weighted[(i, d)] / sums[i]);
        Ok(model)
    }

    /// A model with the baseline of the periods and weights of zero.
    fn unlearned(settings: RhythmicSettings, periods: &[DMatrix<f64>]) -> Result<Self, PeriodError> {
        let kernels = settings.kernels;
        let dimensions = periods.first().map_or(0, DMatrix::ncols);
        if dimensions == 0 {
            return Err(PeriodError::NoDimension);
        }
        for (index, period) in periods.iter().enumerate() {
            if period.ncols() != dimensions {
                let (found, expected) = (period.ncols(), dimensions);
                return Err(PeriodError::Dimensions { index, found, expected });
            }
            if period.nrows() < 4.max(kernels) {
                return Err(PeriodError::TooShort { found: period.nrows(), kernels });
            }
            if let Some(&value) = period.iter().find(|value| !value.is_finite()) {
                return Err(PeriodError::NotFinite { value });
            }
        }
        let baseline = DVector::from_fn(dimensions, |d, _| {
            let least = periods.iter().map(|period| period.column(d).min()).fold(f64::INFINITY, f64::min);
            let most = periods.iter().map(|period| period.column(d).max()).fold(f64::NEG_INFINITY, f64::max);
            0.5 * (least + most)
        });
        Ok(Self::with_weights(settings, DMatrix::zeros(kernels, dimensions), baseline)?)
    }

    /// Returns the features at every sample (samples x kernels) and the target forcing terms (samples x
    /// dimensions).
    fn regression(&self, periods: &[DMatrix<f64>]) -> (DMatrix<f64>, DMatrix<f64>) {
        let spring = CriticalSpring::new(self.settings.damping);
        let samples: usize = periods.iter().map(DMatrix::nrows).sum();
        let mut left = DMatrix::zeros(samples, self.settings.kernels);
        let mut right = DMatrix::zeros(samples, self.dimensions());
        let (mut top, mut features) = (0, vec![0.0; self.settings.kernels]);
        for period in periods {
            let n = period.nrows();
            let step = std::f64::consts::TAU / n as f64;
            for k in 0..n {
                self.features_into(k as f64 * step, &mut features);
                left.row_mut(top + k)
                    .iter_mut()
                    .zip(&features)
                    .for_each(|(place, feature)| *place = *feature);
                for d in 0..self.dimensions() {
                    let [before, here, after] = [(k + n - 1) % n, k, (k + 1) % n].map(|k| period[(k, d)]);
                    let rate = (after - before) / (2.0 * step);
                    let acceleration = (after - 2.0 * here + before) / (step * step);
                    right[(top + k, d)] = acceleration - spring.acceleration(here, rate, self.baseline[d]);
                }
            }
            top += n;
        }
        (left, right)
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.weights.ncols()
    }

    /// Returns the settings.
    pub fn settings(&self) -> &RhythmicSettings {
        &self.settings
    }

    /// Returns the weights, kernels x dimensions.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// Returns the centre of the oscillation of each dimension.
    pub fn baseline(&self) -> &DVector<f64> {
        &self.baseline
    }

    /// Writes the normalised activation of every kernel at a phase (rad) into `features`.
    pub fn features_into(&self, phase: f64, features: &mut [f64]) {
        let count = self.settings.kernels;
        let width = self.settings.width.unwrap_or(count as f64);
        let spacing = std::f64::consts::TAU / count as f64;
        // the addition theorem replaces one cosine per kernel
        let (mut sine, mut cosine) = phase.sin_cos();
        let (turn_sine, turn_cosine) = spacing.sin_cos();
        let nearest = (phase / spacing - (phase / spacing).round()) * spacing;
        let largest = width * (nearest.cos() - 1.0);
        let mut sum = 0.0;
        for feature in features.iter_mut() {
            *feature = (width * (cosine - 1.0) - largest).exp();
            sum += *feature;
            (sine, cosine) =
                (sine * turn_cosine - cosine * turn_sine, cosine * turn_cosine + sine * turn_sine);
        }
        features.iter_mut().for_each(|feature| *feature /= sum);
    }
}

impl From<RhythmicModel> for StoredRhythmicModel {
    fn from(model: RhythmicModel) -> Self {
        let weights = model.weights.column_iter().map(|column| column.iter().copied().collect()).collect();
        Self { settings: model.settings, baseline: model.baseline.as_slice().to_vec(), weights }
    }
}

impl TryFrom<StoredRhythmicModel> for RhythmicModel {
    type Error = ModelError;

    fn try_from(stored: StoredRhythmicModel) -> Result<Self, ModelError> {
        let expected = stored.settings.kernels;
        if let Some(column) = stored.weights.iter().find(|column| column.len() != expected) {
            return Err(ModelError::Value(ValueError::Size {
                name: "a dimension of weights",
                found: column.len(),
                expected,
            }));
        }
        let weights =
            DMatrix::from_iterator(expected, stored.weights.len(), stored.weights.into_iter().flatten());
        Self::with_weights(stored.settings, weights, DVector::from_vec(stored.baseline))
    }
}
