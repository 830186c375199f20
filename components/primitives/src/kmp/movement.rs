//! A kernelised movement over the phase.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Kmp, KmpError, KmpReference, KmpSettings, ReferencePoint};
use crate::ValueError;
use crate::gmm::{Gmm, GmmFit, Gmr};
use crate::mean::MeanMovement;

/// Settings of a fit. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelisedFit {
    /// Number of Gaussians in the reference mixture. Default: chosen from 1 to 12 by the Bayesian information
    /// criterion.
    pub components: Option<usize>,
    /// Number of reference points, evenly spaced from start to end. Default 50.
    pub points: usize,
    /// Kernel and regularisation. Default: `lambda_1` 0.1, `lambda_2` 1, and a kernel length of 0.01, with
    /// which the kernel falls to `1 / e` within a tenth of the movement.
    pub settings: KmpSettings,
}

impl Default for KernelisedFit {
    fn default() -> Self {
        let settings = KmpSettings { mean_regularisation: 0.1, covariance_regularisation: 1.0, length: 0.01 };
        Self { components: None, points: 50, settings }
    }
}

/// A kernelised primitive over the phase (0 at the start, 1 at the end). Its reference is a Gaussian mixture
/// regression of demonstrations.
///
/// ```
/// use motorium_primitives::kmp::{KernelisedFit, KernelisedMovement};
/// use nalgebra::{DMatrix, DVector};
///
/// let shown = |offset: f64| DMatrix::from_fn(60, 1, |k, _| (3.0 * k as f64 / 59.0).sin() + offset);
/// let movement =
///     KernelisedMovement::fit(&[shown(-0.02), shown(0.0), shown(0.02)], 2.0, &KernelisedFit::default())?;
/// let via = movement.conditioned(0.5, &DVector::from_element(1, 1.2), 1e-4)?;
/// assert!((via.kmp()?.mean(&[0.5])?[0] - 1.2).abs() < 1e-2);
/// # Ok::<(), motorium_primitives::kmp::KmpError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredKernelised", into = "StoredKernelised")]
pub struct KernelisedMovement {
    reference: KmpReference,
    settings: KmpSettings,
    duration: f64,
}

/// File format of a [`KernelisedMovement`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredKernelised {
    /// Duration of a demonstration, s.
    pub duration: f64,
    /// Regularisation `lambda_1` of the mean.
    pub mean_regularisation: f64,
    /// Regularisation `lambda_2` of the covariance.
    pub covariance_regularisation: f64,
    /// Length parameter `l` of the kernel.
    pub length: f64,
    /// Phase of each reference point.
    pub phases: Vec<f64>,
    /// Mean of each reference point, one entry per dimension.
    pub means: Vec<Vec<f64>>,
    /// Covariance of each reference point, row by row.
    pub covariances: Vec<Vec<Vec<f64>>>,
}

impl KernelisedMovement {
    /// Fits evenly spaced demonstrations (each samples x dimensions) whose mean duration is `duration`
    /// seconds.
    ///
    /// # Errors
    /// [`KmpError`] if there is no demonstration, their dimensions differ, there are fewer samples than
    /// components, or a setting is out of range.
    pub fn fit(
        demonstrations: &[DMatrix<f64>],
        duration: f64,
        fit: &KernelisedFit,
    ) -> Result<Self, KmpError> {
        let dimensions = demonstrations.first().ok_or(KmpError::Empty)?.ncols();
        if fit.points < 2 {
            let (name, value) = ("points", fit.points as f64);
            return Err(KmpError::Value(ValueError::OutOfRange { name, value, expected: "at least 2" }));
        }
        let rows = demonstrations.iter().map(DMatrix::nrows).sum();
        let mut samples = DMatrix::zeros(rows, dimensions + 1);
        let mut row = 0;
        for shown in demonstrations {
            if shown.ncols() != dimensions {
                let (name, found) = ("a demonstration", shown.ncols());
                return Err(KmpError::Value(ValueError::Size { name, found, expected: dimensions }));
            }
            for k in 0..shown.nrows() {
                samples[(row, 0)] = k as f64 / (shown.nrows() - 1).max(1) as f64;
                samples.view_mut((row, 1), (1, dimensions)).copy_from(&shown.row(k));
                row += 1;
            }
        }
        let settings = GmmFit::default();
        let most = 12.min(rows / (dimensions + 2)).max(1);
        let mixture = match fit.components {
            Some(components) => Gmm::fit(&samples, components, &settings)?,
            None => Gmm::choose(&samples, 1..=most, &settings)?,
        };
        let mut gmr = Gmr::new(&mixture.gmm, 1)?;
        let phase = |k: usize| DVector::from_element(1, k as f64 / (fit.points - 1) as f64);
        let inputs: Vec<DVector<f64>> = (0..fit.points).map(phase).collect();
        Self::new(KmpReference::from_regression(&mut gmr, &inputs)?, fit.settings, duration)
    }

    /// Creates a movement from a reference over the phase and a duration, s.
    ///
    /// # Errors
    /// [`KmpError`] if an input is not a phase, a setting is out of range, or the duration is not positive.
    pub fn new(reference: KmpReference, settings: KmpSettings, duration: f64) -> Result<Self, KmpError> {
        let refuse =
            |name, value, expected| Err(KmpError::Value(ValueError::OutOfRange { name, value, expected }));
        if !(duration > 0.0 && duration.is_finite()) {
            return refuse("duration", duration, "a positive time");
        }
        for point in reference.points() {
            if point.input.len() != 1 || !(0.0..=1.0).contains(&point.input[0]) {
                return refuse("the phase of a reference point", point.input[0], "one number from 0 to 1");
            }
        }
        let movement = Self { reference, settings, duration };
        movement.kmp()?;
        Ok(movement)
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.reference.points()[0].mean.len()
    }

    /// Returns the duration of a demonstration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the reference trajectory.
    pub fn reference(&self) -> &KmpReference {
        &self.reference
    }

    /// Returns the settings of the kernel.
    pub fn settings(&self) -> KmpSettings {
        self.settings
    }

    /// Builds the primitive for evaluation.
    ///
    /// # Errors
    /// [`KmpError`] if a matrix is not positive definite.
    pub fn kmp(&self) -> Result<Kmp, KmpError> {
        Kmp::new(&self.reference, self.settings)
    }

    /// Returns the movement conditioned to pass the position `place` at a phase, with the standard deviation
    /// `deviation`.
    ///
    /// # Errors
    /// [`KmpError`] if the phase is out of range, the number of dimensions differs, or the deviation is not
    /// positive.
    pub fn conditioned(&self, phase: f64, place: &DVector<f64>, deviation: f64) -> Result<Self, KmpError> {
        if !(0.0..=1.0).contains(&phase) {
            let (name, expected) = ("phase", "0 to 1");
            return Err(KmpError::Value(ValueError::OutOfRange { name, value: phase, expected }));
        }
        if !(deviation > 0.0 && deviation.is_finite()) {
            let (name, expected) = ("deviation", "a positive number");
            return Err(KmpError::Value(ValueError::OutOfRange { name, value: deviation, expected }));
        }
        let count = self.dimensions();
        let mut reference = self.reference.clone();
        let point = ReferencePoint {
            input: DVector::from_element(1, phase),
            mean: place.clone(),
            covariance: DMatrix::identity(count, count) * deviation * deviation,
        };
        let spacing = 1.0 / (reference.points().len() - 1).max(1) as f64;
        reference.insert(point, 0.6 * spacing)?;
        Self::new(reference, self.settings, self.duration)
    }

    /// Returns the mean of the movement, prepared for execution over time.
    ///
    /// # Errors
    /// [`KmpError`] if a matrix is not positive definite.
    pub fn running(&self) -> Result<KernelisedMean, KmpError> {
        Ok(KernelisedMean { kmp: self.kmp()?, duration: self.duration })
    }
}

/// Mean of a [`KernelisedMovement`], prepared for execution.
#[derive(Clone, Debug)]
pub struct KernelisedMean {
    kmp: Kmp,
    duration: f64,
}

impl MeanMovement for KernelisedMean {
    fn dimensions(&self) -> usize {
        self.kmp.outputs()
    }

    fn duration(&self) -> f64 {
        self.duration
    }

    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]) {
        self.kmp.mean_into(phase, position, slope);
    }
}

impl From<KernelisedMovement> for StoredKernelised {
    fn from(movement: KernelisedMovement) -> Self {
        let points = movement.reference.points();
        let rows =
            |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        Self {
            duration: movement.duration,
            mean_regularisation: movement.settings.mean_regularisation,
            covariance_regularisation: movement.settings.covariance_regularisation,
            length: movement.settings.length,
            phases: points.iter().map(|point| point.input[0]).collect(),
            means: points.iter().map(|point| point.mean.as_slice().to_vec()).collect(),
            covariances: points.iter().map(|point| rows(&point.covariance)).collect(),
        }
    }
}

impl TryFrom<StoredKernelised> for KernelisedMovement {
    type Error = KmpError;

    fn try_from(stored: StoredKernelised) -> Result<Self, KmpError> {
        let expected = stored.phases.len();
        for (name, found) in [("means", stored.means.len()), ("covariances", stored.covariances.len())] {
            if found != expected {
                return Err(KmpError::Value(ValueError::Size { name, found, expected }));
            }
        }
        let mut points = Vec::with_capacity(expected);
        for ((phase, mean), rows) in stored.phases.iter().zip(stored.means).zip(stored.covariances) {
            let size = rows.len();
            if let Some(row) = rows.iter().find(|row| row.len() != size) {
                let (name, found) = ("a row of a covariance", row.len());
                return Err(KmpError::Value(ValueError::Size { name, found, expected: size }));
            }
            points.push(ReferencePoint {
                input: DVector::from_element(1, *phase),
                mean: DVector::from_vec(mean),
                covariance: DMatrix::from_row_iterator(size, size, rows.into_iter().flatten()),
            });
        }
        let StoredKernelised { duration, mean_regularisation, covariance_regularisation, length, .. } =
            stored;
        let settings = KmpSettings { mean_regularisation, covariance_regularisation, length };
        Self::new(KmpReference::new(points)?, settings, duration)
    }
}
