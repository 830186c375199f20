//! A rhythmic primitive.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::discrete::MoveError;
use super::kernels::dot;
use super::settings::ModelError;
use super::spring::CriticalSpring;

/// The settings of a rhythmic primitive; [`Default`] gives the values named on each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RhythmicSettings {
    /// Number of kernels round the circle for each dimension, at least 3. Default 30.
    pub kernels: usize,
    /// Damping `D` of the transformation system; its stiffness is `K = D^2 / 4`, critically damped. Default 25.
    pub damping: f64,
    /// Width parameter `h` of the kernels. Default: the number of kernels.
    pub width: Option<f64>,
}

impl Default for RhythmicSettings {
    fn default() -> Self {
        Self { kernels: 30, damping: 25.0, width: None }
    }
}

/// What a rhythmic primitive has learned; constant while it runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredRhythmicModel", into = "StoredRhythmicModel")]
pub struct RhythmicModel {
    settings: RhythmicSettings,
    /// Kernels x dimensions.
    weights: DMatrix<f64>,
    baseline: DVector<f64>,
}

/// A [`RhythmicModel`] as it is written to a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredRhythmicModel {
    /// The settings.
    pub settings: RhythmicSettings,
    /// The value about which each dimension swings.
    pub baseline: Vec<f64>,
    /// For each dimension, the weight of each kernel.
    pub weights: Vec<Vec<f64>>,
}

/// Why a recording is no period to learn from.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PeriodError {
    /// Too little of it.
    #[error(
        "{found} samples in one period, expected at least 4 and at least one for each of the {kernels} kernels"
    )]
    TooShort {
        /// Samples found.
        found: usize,
        /// Kernels to be determined.
        kernels: usize,
    },
    /// No dimension at all.
    #[error("samples without a single dimension")]
    NoDimension,
    /// Periods of different kinds.
    #[error("period {index} has {found} dimensions, the first one {expected}")]
    Dimensions {
        /// Which one.
        index: usize,
        /// Its dimensions.
        found: usize,
        /// Those of the first.
        expected: usize,
    },
    /// A sample that is not a number.
    #[error("a sample is {value}: cut the recording or fill the gap")]
    NotFinite {
        /// What was found.
        value: f64,
    },
    /// The settings make no model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl RhythmicModel {
    /// From weights (kernels x dimensions) and the baseline of each dimension.
    ///
    /// # Errors
    /// A setting out of range, sizes that do not fit, or numbers that are not finite.
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
                return Err(ModelError::OutOfRange { name, value, expected });
            }
        }
        if weights.nrows() != settings.kernels {
            let (found, expected) = (weights.nrows(), settings.kernels);
            return Err(ModelError::Size { name: "a column of weights", found, expected });
        }
        if baseline.len() != weights.ncols() {
            let (found, expected) = (baseline.len(), weights.ncols());
            return Err(ModelError::Size { name: "baseline", found, expected });
        }
        for (name, values) in [("weights", weights.as_slice()), ("baseline", baseline.as_slice())] {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ModelError::NotFinite { name, value });
            }
        }
        Ok(Self { settings, weights, baseline })
    }

    /// Fits a primitive to one period or several, by ridge regression with the penalty `lambda >= 0`.
    ///
    /// Each period is evenly spaced samples x dimensions from phase 0 on, without the sample at its end that is the first
    /// of the next period. Derivatives are central differences round the circle. The baseline is the middle of the range.
    /// The duration of the period does not matter: the weights are those of normalised time.
    ///
    /// # Errors
    /// Too few samples, different dimensions, numbers that are not finite, or settings out of range.
    pub fn fit(
        settings: RhythmicSettings,
        periods: &[DMatrix<f64>],
        lambda: f64,
    ) -> Result<Self, PeriodError> {
        let kernels = settings.kernels;
        let dimensions = periods.first().map_or(0, DMatrix::ncols);
        if dimensions == 0 {
            return Err(PeriodError::NoDimension);
        }
        if !(lambda.is_finite() && lambda >= 0.0) {
            let expected = "a finite number of at least 0";
            return Err(ModelError::OutOfRange { name: "lambda", value: lambda, expected }.into());
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
            let all =
                || periods.iter().flat_map(|period| period.column(d).iter().copied().collect::<Vec<_>>());
            0.5 * (all().fold(f64::INFINITY, f64::min) + all().fold(f64::NEG_INFINITY, f64::max))
        });
        let mut model = Self::with_weights(settings, DMatrix::zeros(kernels, dimensions), baseline)?;
        let spring = CriticalSpring::new(model.settings.damping);
        let samples: usize = periods.iter().map(DMatrix::nrows).sum();
        let mut left = DMatrix::zeros(samples + kernels, kernels);
        let mut right = DMatrix::zeros(samples + kernels, dimensions);
        let (mut top, mut features) = (0, vec![0.0; kernels]);
        for period in periods {
            let n = period.nrows();
            let step = std::f64::consts::TAU / n as f64;
            for k in 0..n {
                model.features_into(k as f64 * step, &mut features);
                left.row_mut(top + k)
                    .iter_mut()
                    .zip(&features)
                    .for_each(|(place, feature)| *place = *feature);
                for d in 0..dimensions {
                    let [before, here, after] = [(k + n - 1) % n, k, (k + 1) % n].map(|k| period[(k, d)]);
                    let rate = (after - before) / (2.0 * step);
                    let acceleration = (after - 2.0 * here + before) / (step * step);
                    right[(top + k, d)] = acceleration - spring.acceleration(here, rate, model.baseline[d]);
                }
            }
            top += n;
        }
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

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.weights.ncols()
    }

    /// The settings.
    pub fn settings(&self) -> &RhythmicSettings {
        &self.settings
    }

    /// The weights, kernels x dimensions.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// The value about which each dimension swings.
    pub fn baseline(&self) -> &DVector<f64> {
        &self.baseline
    }

    /// Writes the normalised activation of every kernel at a phase (rad) into `features`.
    pub fn features_into(&self, phase: f64, features: &mut [f64]) {
        let count = self.settings.kernels;
        let width = self.settings.width.unwrap_or(count as f64);
        let spacing = std::f64::consts::TAU / count as f64;
        // round the circle from kernel to kernel with the addition theorem instead of a cosine each
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
            return Err(ModelError::Size { name: "a dimension of weights", found: column.len(), expected });
        }
        let weights =
            DMatrix::from_iterator(expected, stored.weights.len(), stored.weights.into_iter().flatten());
        Self::with_weights(stored.settings, weights, DVector::from_vec(stored.baseline))
    }
}

/// A rhythm in progress (Ijspeert et al. 2013, section 2.1.2): with the period `P`, `tau = P / (2 pi)` and the phase
/// `tau phi' = 1`,
///
/// `tau^2 y'' = K (g - y) - D tau y' + r f`, `f = sum(psi_i w_i) / sum(psi_i)`,
/// `psi_i = exp(h (cos(phi - c_i) - 1))`, `c_i = 2 pi i / N`, `K = D^2 / 4`.
///
/// `g` is the baseline, `r` the amplitude (1 is that of the demonstration). Period, amplitude and baseline may change at
/// any time; position and velocity stay continuous. The spring is advanced exactly for an input that is linear within a
/// step. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct RhythmicDmp {
    model: RhythmicModel,
    period: f64,
    phase: f64,
    cycles: u64,
    amplitude: f64,
    baseline: Vec<f64>,
    forcing: Vec<f64>,
    features: Vec<f64>,
    /// Position and its derivative by the phase.
    state: Vec<(f64, f64)>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl RhythmicDmp {
    /// At rest at its baseline with a period of 1 s, at phase 0.
    pub fn new(model: RhythmicModel) -> Self {
        let zeros = vec![0.0; model.dimensions()];
        let baseline = model.baseline.as_slice().to_vec();
        let mut dmp = Self {
            period: 1.0,
            phase: 0.0,
            cycles: 0,
            amplitude: 1.0,
            forcing: zeros.clone(),
            features: vec![0.0; model.settings.kernels],
            state: baseline.iter().map(|value| (*value, 0.0)).collect(),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            baseline,
            model,
        };
        dmp.update_forcing();
        dmp.observe();
        dmp
    }

    /// The model it runs.
    pub fn model(&self) -> &RhythmicModel {
        &self.model
    }

    /// Starts at a phase (rad) from a position and a velocity (per second); from there it falls into its rhythm.
    ///
    /// # Errors
    /// Wrong lengths, or numbers that are not finite.
    pub fn start(&mut self, phase: f64, position: &[f64], velocity: &[f64]) -> Result<(), MoveError> {
        finite("phase", &[phase], 1)?;
        finite("position", position, self.state.len())?;
        finite("velocity", velocity, self.state.len())?;
        let tau = self.period / std::f64::consts::TAU;
        for (state, (y, v)) in self.state.iter_mut().zip(position.iter().zip(velocity)) {
            *state = (*y, v * tau);
        }
        self.phase = phase.rem_euclid(std::f64::consts::TAU);
        self.cycles = 0;
        self.update_forcing();
        self.observe();
        Ok(())
    }

    /// Sets the period, s.
    ///
    /// # Errors
    /// A period that is no positive time.
    pub fn set_period(&mut self, period: f64) -> Result<(), MoveError> {
        if !(period.is_finite() && period > 0.0) {
            return Err(MoveError::Duration { found: period });
        }
        let stretch = period / self.period;
        self.state.iter_mut().for_each(|(_, rate)| *rate *= stretch);
        self.period = period;
        self.observe();
        Ok(())
    }

    /// Sets the amplitude: 1 is that of the demonstration.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn set_amplitude(&mut self, amplitude: f64) -> Result<(), MoveError> {
        finite("amplitude", &[amplitude], 1)?;
        self.amplitude = amplitude;
        self.update_forcing();
        self.observe();
        Ok(())
    }

    /// Sets the value about which each dimension swings.
    ///
    /// # Errors
    /// Wrong length, or numbers that are not finite.
    pub fn set_baseline(&mut self, baseline: &[f64]) -> Result<(), MoveError> {
        finite("baseline", baseline, self.state.len())?;
        self.baseline.copy_from_slice(baseline);
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds. A `dt` of zero or less changes nothing.
    pub fn step(&mut self, dt: f64) {
        self.step_entrained(dt, 0.0);
    }

    /// As [`step`](Self::step), the phase drawn along by `pull` (rad/s), such as `k sin(phi_measured - phi)`.
    pub fn step_entrained(&mut self, dt: f64, pull: f64) {
        let h = dt * std::f64::consts::TAU / self.period;
        let advance = h + if pull.is_finite() { pull * dt } else { 0.0 };
        if h.is_nan() || h <= 0.0 {
            return;
        }
        let stride = CriticalSpring::new(self.model.settings.damping).stride(h);
        self.position.copy_from_slice(&self.forcing);
        self.phase += advance;
        if !(0.0..std::f64::consts::TAU).contains(&self.phase) {
            self.cycles += u64::from(self.phase > 0.0);
            self.phase = self.phase.rem_euclid(std::f64::consts::TAU);
        }
        self.update_forcing();
        for (d, state) in self.state.iter_mut().enumerate() {
            let (from, to) = (self.baseline[d] + self.position[d], self.baseline[d] + self.forcing[d]);
            *state = stride.advance(*state, from, to);
        }
        self.observe();
    }

    /// Position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Acceleration in every dimension, per second squared.
    pub fn acceleration(&self) -> &[f64] {
        &self.acceleration
    }

    /// The phase in \[0, 2 pi), rad.
    pub fn phase(&self) -> f64 {
        self.phase
    }

    /// Whole periods since the start.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// The forcing term as a shift of the equilibrium.
    fn update_forcing(&mut self) {
        self.model.features_into(self.phase, &mut self.features);
        let factor = self.amplitude / CriticalSpring::new(self.model.settings.damping).stiffness();
        let columns = self.model.weights.as_slice().chunks_exact(self.features.len());
        for (forcing, weights) in self.forcing.iter_mut().zip(columns) {
            *forcing = factor * dot(weights, &self.features);
        }
    }

    fn observe(&mut self) {
        let spring = CriticalSpring::new(self.model.settings.damping);
        let per_second = std::f64::consts::TAU / self.period;
        for (d, (y, rate)) in self.state.iter().enumerate() {
            self.position[d] = *y;
            self.velocity[d] = rate * per_second;
            let equilibrium = self.baseline[d] + self.forcing[d];
            self.acceleration[d] = spring.acceleration(*y, *rate, equilibrium) * per_second * per_second;
        }
    }
}

fn finite(name: &'static str, values: &[f64], expected: usize) -> Result<(), MoveError> {
    if values.len() != expected {
        return Err(MoveError::Dimensions { name, found: values.len(), expected });
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(MoveError::NotFinite { name, value }),
        None => Ok(()),
    }
}
