//! Weights from demonstrations.

use nalgebra::{DMatrix, DVector};

use super::demonstration::Demonstration;
use super::kernels::Kernels;
use super::model::DmpModel;
use super::quintic::{Jet, Quintic};
use super::scaling::ForcingScale;
use super::settings::{ModelError, Scaling, Settings, Variant};

/// Regression method for the weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regression {
    /// Least squares on the forcing term with the penalty `lambda |w|^2`, over all kernels together. This is
    /// the default, with `lambda = 1e-12`. For the same number of kernels, ridge regression fits far more
    /// closely than locally weighted regression.
    Ridge {
        /// Penalty, at least 0.
        lambda: f64,
    },
    /// Separate fit of each kernel: `w_i = sum psi_i g f / sum psi_i g^2`, with the gate `g` and the forcing
    /// term `f` (Ijspeert et al. 2013).
    LocallyWeighted,
    /// Least squares on the *position* through the response of the spring to every kernel, with the penalty
    /// `lambda |w|^2`. This method uses no derivatives inside the movement and therefore suits noisy
    /// recordings.
    Response {
        /// Penalty, at least 0.
        lambda: f64,
    },
}

impl Default for Regression {
    fn default() -> Self {
        Self::Ridge { lambda: 1e-12 }
    }
}

/// Error returned when a primitive cannot be fitted to demonstrations.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No demonstration was given.
    #[error("no demonstration given, expected at least one")]
    NoDemonstration,
    /// Demonstrations differ in their number of dimensions.
    #[error(
        "demonstration {index} has {found} dimensions, expected {expected} as in the first demonstration"
    )]
    Dimensions {
        /// Index of the demonstration, from 0.
        index: usize,
        /// Number of dimensions found.
        found: usize,
        /// Number of dimensions of the first demonstration.
        expected: usize,
    },
    /// The penalty is negative or not finite.
    #[error("lambda = {found}: expected a finite number of at least 0")]
    Lambda {
        /// Penalty found.
        found: f64,
    },
    /// The samples do not determine the weights of all kernels.
    #[error(
        "{samples} samples cannot determine {kernels} kernels: use fewer kernels, more samples or lambda > 0"
    )]
    Undetermined {
        /// Number of samples over all demonstrations.
        samples: usize,
        /// Number of kernels of each dimension.
        kernels: usize,
    },
    /// The settings are invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl DmpModel {
    /// Fits a primitive to one or more demonstrations of the same movement.
    ///
    /// The first and last sample of each demonstration are its start and goal. The displacement of the model
    /// is the mean over the demonstrations.
    ///
    /// # Errors
    /// [`FitError`] if there is no demonstration, their dimensions differ, the penalty is negative, the
    /// samples do not determine the weights, or a setting is out of range.
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

/// Linear equations of one demonstration: `features * (factors[d] * w_d) = targets_d` for every dimension d.
struct Block {
    /// Kernels x samples.
    features: DMatrix<f64>,
    /// Samples x dimensions.
    targets: DMatrix<f64>,
    /// Scaling factor of each dimension.
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
        if matches!(model.settings().scaling, Scaling::Similarity { .. }) {
            let mut row = start;
            for k in 0..targets.nrows() {
                row.iter_mut().enumerate().for_each(|(d, value)| *value = targets[(k, d)]);
                scale.unrotate(&mut row);
                row.iter().enumerate().for_each(|(d, value)| targets[(k, d)] = *value);
            }
        }
        Self { features, targets, factors: (0..demo.dimensions()).map(|d| scale.factor(d)).collect() }
    }
}

fn progress_of(sample: usize, samples: usize) -> f64 {
    sample as f64 / (samples - 1) as f64
}

/// Returns the features of the forcing term at every sample, kernels x samples.
fn activations(model: &DmpModel, samples: usize) -> DMatrix<f64> {
    let kernels = model.kernels();
    let mut features = DMatrix::zeros(kernels.count(), samples);
    for (k, row) in features.as_mut_slice().chunks_exact_mut(kernels.count()).enumerate() {
        kernels.features_into(progress_of(k, samples), row);
    }
    features
}

/// Returns the position at every sample when each kernel alone drives the resting spring with weight 1,
/// kernels x samples.
fn responses(model: &DmpModel, samples: usize) -> DMatrix<f64> {
    let substeps = 1000_usize.div_ceil(samples - 1);
    let fine = activations(model, (samples - 1) * substeps + 1) / model.forcing_divisor();
    let stride = model.spring().stride(progress_of(1, fine.ncols()));
    let mut responses = DMatrix::zeros(fine.nrows(), samples);
    for (i, input) in fine.row_iter().enumerate() {
        let mut state = (0.0, 0.0);
        for k in 1..fine.ncols() {
            state = stride.advance(state, input[k - 1], input[k]);
            if k % substeps == 0 {
                responses[(i, k / substeps)] = state.0;
            }
        }
    }
    responses
}

/// Returns the forcing term that reproduces the demonstration, in the unit of the weights, samples x
/// dimensions.
fn forcing_terms(model: &DmpModel, demo: &Demonstration) -> DMatrix<f64> {
    let (spring, duration) = (model.spring(), demo.duration());
    let variant = model.settings().variant;
    let samples = demo.samples();
    let pull =
        |jet: Jet, equilibrium| jet.acceleration - spring.acceleration(jet.value, jet.rate, equilibrium);
    let per_sample = progress_of(1, samples);
    let mut forcing = DMatrix::zeros(samples, demo.dimensions());
    for (d, column) in forcing.as_mut_slice().chunks_exact_mut(samples).enumerate() {
        let (start, goal) = (demo.start(d), demo.goal(d));
        let range = d * samples..(d + 1) * samples;
        let jets = demo.positions().as_slice()[range.clone()]
            .iter()
            .zip(&demo.velocities().as_slice()[range.clone()])
            .zip(&demo.accelerations().as_slice()[range])
            .map(|((y, v), a)| Jet { value: *y, rate: v * duration, acceleration: a * duration * duration });
        if variant.plans_goal() {
            let reference = reference(model, demo, d);
            for (k, (forcing, jet)) in column.iter_mut().zip(jets).enumerate() {
                *forcing = pull(deviation(jet, &reference, k as f64 * per_sample), 0.0);
            }
        } else if variant.eases_in() {
            for (k, (forcing, jet)) in column.iter_mut().zip(jets).enumerate() {
                let phase = model.kernels().phase(progress_of(k, samples));
                *forcing = pull(jet, goal) / spring.stiffness() + (goal - start) * phase;
            }
        } else {
            column.iter_mut().zip(jets).for_each(|(forcing, jet)| *forcing = pull(jet, goal));
        }
    }
    forcing
}

/// Returns the difference between the demonstration and the unforced movement, samples x dimensions.
fn forced_positions(model: &DmpModel, demo: &Demonstration) -> DMatrix<f64> {
    let (samples, variant) = (demo.samples(), model.settings().variant);
    let mut targets = demo.positions().clone();
    if variant.plans_goal() {
        for d in 0..demo.dimensions() {
            let reference = reference(model, demo, d);
            for k in 0..samples {
                targets[(k, d)] -= reference.sample(progress_of(k, samples)).value;
            }
        }
        return targets;
    }
    let substeps = 1000_usize.div_ceil(samples - 1);
    let fine = (samples - 1) * substeps + 1;
    let stride = model.spring().stride(progress_of(1, fine));
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

/// Returns the polynomial with the start and end of a demonstration: to rest, or with its final velocity if
/// the variant has one.
///
/// The polynomial starts without acceleration, like a movement started with a velocity only. The initial
/// acceleration of the demonstration becomes part of the forcing term.
pub(super) fn reference(model: &DmpModel, demo: &Demonstration, dimension: usize) -> Quintic {
    let first = normalised(demo, 0, dimension, demo.duration());
    let last = normalised(demo, demo.samples() - 1, dimension, demo.duration());
    let final_rate = if model.settings().variant.may_end_in_motion() { last.rate } else { 0.0 };
    Quintic::passing(0.0, 1.0, Jet { acceleration: 0.0, ..first }, last.value, final_rate)
}

fn deviation(jet: Jet, reference: &Quintic, progress: f64) -> Jet {
    let reference = reference.sample(progress);
    Jet {
        value: jet.value - reference.value,
        rate: jet.rate - reference.rate,
        acceleration: jet.acceleration - reference.acceleration,
    }
}

/// Ridge regression: by the normal equations if the penalty keeps them well conditioned, else by QR.
fn ridge(blocks: &[Block], dimensions: usize, lambda: f64) -> Result<DMatrix<f64>, FitError> {
    let uniform = |block: &Block| block.factors.iter().all(|factor| *factor == block.factors[0]);
    let each: Vec<(usize, usize)> = if blocks.iter().all(uniform) {
        vec![(0, dimensions)]
    } else {
        (0..dimensions).map(|d| (d, 1)).collect()
    };
    let mut weights = DMatrix::zeros(blocks[0].features.nrows(), dimensions);
    for (first, columns) in each {
        let solution = match normal_equations(blocks, first, columns, lambda) {
            Some(solution) => solution,
            None => orthogonal(blocks, first, columns, lambda)?,
        };
        weights.columns_mut(first, columns).copy_from(&solution);
    }
    Ok(weights)
}

/// `(F F^T + lambda I) w = F t` by Cholesky. This squares the condition number of the features and is used
/// only if the penalty bounds it by 1e14. The error is then confined to directions in which the features are
/// nearly blind; it changes the forcing term by about 1e-9 of its value.
fn normal_equations(blocks: &[Block], first: usize, columns: usize, lambda: f64) -> Option<DMatrix<f64>> {
    let kernels = blocks[0].features.nrows();
    let mut normal = DMatrix::zeros(kernels, kernels);
    let mut right = DMatrix::zeros(kernels, columns);
    for block in blocks {
        let factor = block.factors[first];
        let samples = block.features.ncols();
        // late kernels are zero in early samples: process a sixth of the samples at a time, with the active
        // kernels only
        let part = samples.div_ceil(6).max(8);
        for from in (0..samples).step_by(part) {
            let count = part.min(samples - from);
            let features = block.features.columns(from, count);
            let awake = (0..kernels)
                .rev()
                .find(|i| features.row(*i).iter().any(|feature| *feature != 0.0))
                .map_or(0, |last| last + 1);
            let features = features.rows(0, awake);
            let transposed = features.transpose();
            normal.view_mut((0, 0), (awake, awake)).gemm(factor * factor, &features, &transposed, 1.0);
            let targets = block.targets.view((from, first), (count, columns));
            right.rows_mut(0, awake).gemm(factor, &features, &targets, 1.0);
        }
    }
    if lambda < 1e-14 * normal.trace() {
        return None;
    }
    for i in 0..kernels {
        normal[(i, i)] += lambda;
    }
    let solution = normal.cholesky()?.solve(&right);
    solution.iter().all(|value| value.is_finite()).then_some(solution)
}

/// Least squares on the features with `sqrt(lambda)` times the identity below them, by Householder QR: this
/// does not square the condition number, which narrow, overlapping kernels without a penalty require.
fn orthogonal(blocks: &[Block], first: usize, columns: usize, lambda: f64) -> Result<DMatrix<f64>, FitError> {
    let kernels = blocks[0].features.nrows();
    let samples: usize = blocks.iter().map(|block| block.features.ncols()).sum();
    let undetermined = || FitError::Undetermined { samples, kernels };
    if lambda == 0.0 && samples < kernels {
        return Err(undetermined());
    }
    let mut left = DMatrix::zeros(samples + kernels, kernels);
    let mut right = DMatrix::zeros(samples + kernels, columns);
    let mut top = 0;
    for block in blocks {
        let rows = block.features.ncols();
        left.rows_mut(top, rows).copy_from(&(block.features.transpose() * block.factors[first]));
        right.rows_mut(top, rows).copy_from(&block.targets.columns(first, columns));
        top += rows;
    }
    left.rows_mut(samples, kernels).fill_diagonal(lambda.sqrt());
    let factored = left.qr();
    factored.q_tr_mul(&mut right);
    let triangle = factored.r();
    let solution = right.rows(0, kernels).into_owned();
    let largest = triangle.diagonal().amax();
    if triangle.diagonal().iter().any(|pivot| pivot.abs() <= largest * f64::EPSILON) {
        return Err(undetermined());
    }
    triangle.solve_upper_triangular(&solution).ok_or_else(undetermined)
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
