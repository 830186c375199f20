//! Weights from demonstrations.

use nalgebra::{DMatrix, DVector};

use super::demonstration::Demonstration;
use super::kernels::Kernels;
use super::model::DmpModel;
use super::quintic::{Jet, Quintic};
use super::scaling::ForcingScale;
use super::settings::{ModelError, Settings, Variant};

/// How weights are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regression {
    /// Least squares on the forcing term with the penalty `lambda |w|^2`, over all kernels together. The default, with
    /// `lambda = 1e-12`: at the same number of kernels far closer than locally weighted regression.
    Ridge {
        /// The penalty, at least 0.
        lambda: f64,
    },
    /// Each kernel by itself: `w_i = sum psi_i g f / sum psi_i g^2`, `g` the gate (Ijspeert et al. 2013).
    LocallyWeighted,
    /// Least squares on the *position* through the response of the spring to every kernel, with the penalty
    /// `lambda |w|^2`. Uses no derivative inside the movement, so it is the one for noisy recordings.
    Response {
        /// The penalty, at least 0.
        lambda: f64,
    },
}

impl Default for Regression {
    fn default() -> Self {
        Self::Ridge { lambda: 1e-12 }
    }
}

/// Why no primitive could be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Nothing to learn from.
    #[error("no demonstration given, expected at least one")]
    NoDemonstration,
    /// Demonstrations of different kinds.
    #[error("demonstration {index} has {found} dimensions, the first one {expected}")]
    Dimensions {
        /// Which one.
        index: usize,
        /// Its dimensions.
        found: usize,
        /// Those of the first.
        expected: usize,
    },
    /// A penalty that is no penalty.
    #[error("lambda = {found}: expected a finite number of at least 0")]
    Lambda {
        /// What was found.
        found: f64,
    },
    /// The kernels cannot be told apart by the samples there are.
    #[error(
        "{samples} samples cannot determine {kernels} kernels: take fewer kernels, more samples or lambda > 0"
    )]
    Undetermined {
        /// Samples over all demonstrations.
        samples: usize,
        /// Kernels of each dimension.
        kernels: usize,
    },
    /// The settings make no model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl DmpModel {
    /// Fits a primitive to one demonstration or to several of the same movement.
    ///
    /// Start and goal of each are its first and last sample; the displacement of the model is their mean displacement.
    ///
    /// # Errors
    /// No demonstration, different dimensions, a negative penalty, an undetermined regression, or settings out of range.
    pub fn fit(
        settings: Settings,
        demonstrations: &[Demonstration],
        regression: Regression,
    ) -> Result<Self, FitError> {
        let dimensions = demonstrations.first().ok_or(FitError::NoDemonstration)?.dimensions();
        for (index, demonstration) in demonstrations.iter().enumerate() {
            let found = demonstration.dimensions();
            if found != dimensions {
                return Err(FitError::Dimensions { index, found, expected: dimensions });
            }
        }
        if let Regression::Ridge { lambda: found } | Regression::Response { lambda: found } = regression
            && !(found.is_finite() && found >= 0.0)
        {
            return Err(FitError::Lambda { found });
        }
        let displacement = DVector::from_fn(dimensions, |d, _| {
            demonstrations.iter().map(|demo| demo.goal(d) - demo.start(d)).sum::<f64>()
                / demonstrations.len() as f64
        });
        let weights = DMatrix::zeros(settings.kernels, dimensions);
        let mut model = Self::with_weights(settings, weights, displacement)?;
        let blocks: Vec<Block> =
            demonstrations.iter().map(|demo| Block::new(&model, demo, regression)).collect();
        let weights = match regression {
            Regression::LocallyWeighted => locally_weighted(model.kernels(), &blocks, dimensions),
            Regression::Ridge { lambda } | Regression::Response { lambda } => {
                ridge(&blocks, dimensions, lambda)?
            }
        };
        model.weights_mut().copy_from(&weights);
        Ok(model)
    }
}

/// What one demonstration asks of the weights: `features * (factors[d] * w_d) = targets_d` for every dimension d.
struct Block {
    /// Samples x kernels.
    features: DMatrix<f64>,
    /// Samples x dimensions.
    targets: DMatrix<f64>,
    /// Of each dimension, from the scaling.
    factors: Vec<f64>,
}

impl Block {
    fn new(model: &DmpModel, demo: &Demonstration, regression: Regression) -> Self {
        let position = matches!(regression, Regression::Response { .. });
        let features =
            if position { responses(model, demo.samples()) } else { activations(model, demo.samples()) };
        let mut targets = if position { forced_positions(model, demo) } else { forcing_terms(model, demo) };
        let (start, goal): (Vec<f64>, Vec<f64>) =
            (0..demo.dimensions()).map(|d| (demo.start(d), demo.goal(d))).unzip();
        let mut scale = ForcingScale::new(model.settings().scaling, demo.dimensions());
        scale.prepare(model.displacement(), &start, &goal);
        let mut row = start;
        for k in 0..targets.nrows() {
            row.iter_mut().enumerate().for_each(|(d, value)| *value = targets[(k, d)]);
            scale.unrotate(&mut row);
            row.iter().enumerate().for_each(|(d, value)| targets[(k, d)] = *value);
        }
        Self { features, targets, factors: (0..demo.dimensions()).map(|d| scale.factor(d)).collect() }
    }
}

fn progress_of(sample: usize, samples: usize) -> f64 {
    sample as f64 / (samples - 1) as f64
}

/// The features of the forcing term at every sample, samples x kernels.
fn activations(model: &DmpModel, samples: usize) -> DMatrix<f64> {
    let kernels = model.kernels();
    let mut features = DMatrix::zeros(samples, kernels.count());
    let mut row = vec![0.0; kernels.count()];
    for k in 0..samples {
        kernels.features_into(progress_of(k, samples), &mut row);
        row.iter().enumerate().for_each(|(i, value)| features[(k, i)] = *value);
    }
    features
}

/// The position at every sample when one kernel after the other drives the resting spring with weight 1, samples x kernels.
fn responses(model: &DmpModel, samples: usize) -> DMatrix<f64> {
    let substeps = 1000_usize.div_ceil(samples - 1);
    let fine = activations(model, (samples - 1) * substeps + 1) / model.forcing_divisor();
    let stride = model.spring().stride(progress_of(1, fine.nrows()));
    let mut responses = DMatrix::zeros(samples, fine.ncols());
    for (i, input) in fine.column_iter().enumerate() {
        let mut state = (0.0, 0.0);
        for k in 1..fine.nrows() {
            state = stride.advance(state, input[k - 1], input[k]);
            if k % substeps == 0 {
                responses[(k / substeps, i)] = state.0;
            }
        }
    }
    responses
}

/// The forcing term that reproduces the demonstration, in the unit of the weights, samples x dimensions.
fn forcing_terms(model: &DmpModel, demo: &Demonstration) -> DMatrix<f64> {
    let (spring, duration) = (model.spring(), demo.duration());
    let variant = model.settings().variant;
    DMatrix::from_fn(demo.samples(), demo.dimensions(), |k, d| {
        let progress = progress_of(k, demo.samples());
        let (start, goal) = (demo.start(d), demo.goal(d));
        let jet = normalised(demo, k, d, duration);
        let pull =
            |jet: Jet, equilibrium| jet.acceleration - spring.acceleration(jet.value, jet.rate, equilibrium);
        match variant {
            Variant::Classic => pull(jet, goal),
            Variant::GoalSafe => {
                let phase = model.kernels().phase(progress);
                pull(jet, goal) / spring.stiffness() + (goal - start) * phase
            }
            Variant::QuinticGoal => pull(deviation(demo, k, d), 0.0),
        }
    })
}

/// What the forcing term must add to the position of the unforced movement, samples x dimensions.
fn forced_positions(model: &DmpModel, demo: &Demonstration) -> DMatrix<f64> {
    let (samples, variant) = (demo.samples(), model.settings().variant);
    if variant == Variant::QuinticGoal {
        return DMatrix::from_fn(samples, demo.dimensions(), |k, d| deviation(demo, k, d).value);
    }
    let substeps = 1000_usize.div_ceil(samples - 1);
    let fine = (samples - 1) * substeps + 1;
    let stride = model.spring().stride(progress_of(1, fine));
    let mut targets = demo.positions().clone();
    for d in 0..demo.dimensions() {
        let (start, goal) = (demo.start(d), demo.goal(d));
        let equilibrium = |k: usize| match variant {
            Variant::GoalSafe => goal - (goal - start) * model.kernels().phase(progress_of(k, fine)),
            _ => goal,
        };
        let first = normalised(demo, 0, d, demo.duration());
        let mut state = (first.value, first.rate);
        targets[(0, d)] = 0.0;
        for k in 1..fine {
            state = stride.advance(state, equilibrium(k - 1), equilibrium(k));
            if k % substeps == 0 {
                targets[(k / substeps, d)] -= state.0;
            }
        }
    }
    targets
}

/// A sample with its derivatives with respect to progress.
fn normalised(demo: &Demonstration, sample: usize, dimension: usize, duration: f64) -> Jet {
    let at = (sample, dimension);
    Jet {
        value: demo.positions()[at],
        rate: demo.velocities()[at] * duration,
        acceleration: demo.accelerations()[at] * duration * duration,
    }
}

/// A sample less the minimum-jerk movement with the same start and goal.
fn deviation(demo: &Demonstration, sample: usize, dimension: usize) -> Jet {
    let first = normalised(demo, 0, dimension, demo.duration());
    let quintic = Quintic::new(0.0, 1.0, first, demo.goal(dimension));
    let reference = quintic.sample(progress_of(sample, demo.samples()));
    let jet = normalised(demo, sample, dimension, demo.duration());
    Jet {
        value: jet.value - reference.value,
        rate: jet.rate - reference.rate,
        acceleration: jet.acceleration - reference.acceleration,
    }
}

/// Ridge regression as least squares on the features with `sqrt(lambda)` times the identity below them, by Householder
/// QR: the condition of the features is not squared, which narrow, overlapping kernels would not survive.
fn ridge(blocks: &[Block], dimensions: usize, lambda: f64) -> Result<DMatrix<f64>, FitError> {
    let kernels = blocks[0].features.ncols();
    let samples: usize = blocks.iter().map(|block| block.features.nrows()).sum();
    let undetermined = || FitError::Undetermined { samples, kernels };
    if lambda == 0.0 && samples < kernels {
        return Err(undetermined());
    }
    let solve = |dimension: usize, columns: usize| {
        let mut left = DMatrix::zeros(samples + kernels, kernels);
        let mut right = DMatrix::zeros(samples + kernels, columns);
        let mut top = 0;
        for block in blocks {
            let rows = block.features.nrows();
            left.rows_mut(top, rows).copy_from(&(&block.features * block.factors[dimension]));
            right.rows_mut(top, rows).copy_from(&block.targets.columns(dimension, columns));
            top += rows;
        }
        left.rows_mut(samples, kernels).fill_diagonal(lambda.sqrt());
        let factored = left.qr();
        factored.q_tr_mul(&mut right);
        let triangle = factored.r();
        let solution = right.rows(0, kernels).into_owned();
        let largest = triangle.diagonal().amax();
        if triangle.diagonal().iter().any(|pivot| pivot.abs() <= largest * f64::EPSILON) {
            return None;
        }
        triangle.solve_upper_triangular(&solution)
    };
    let uniform = |block: &Block| block.factors.iter().all(|factor| *factor == block.factors[0]);
    if blocks.iter().all(uniform) {
        return solve(0, dimensions).ok_or_else(undetermined);
    }
    let columns: Option<Vec<_>> = (0..dimensions).map(|d| solve(d, 1)).collect();
    let columns = columns.ok_or_else(undetermined)?;
    Ok(DMatrix::from_fn(kernels, dimensions, |i, d| columns[d][(i, 0)]))
}

fn locally_weighted(kernels: &Kernels, blocks: &[Block], dimensions: usize) -> DMatrix<f64> {
    DMatrix::from_fn(kernels.count(), dimensions, |i, d| {
        let (mut product, mut square) = (0.0, 0.0);
        for block in blocks {
            for k in 0..block.targets.nrows() {
                let progress = progress_of(k, block.targets.nrows());
                let input = kernels.gate(progress) * block.factors[d];
                let weight = kernels.kernel(i, kernels.phase(progress));
                product += weight * input * block.targets[(k, d)];
                square += weight * input * input;
            }
        }
        if square > f64::MIN_POSITIVE { product / square } else { 0.0 }
    })
}
