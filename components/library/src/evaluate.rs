//! Errors of a basis on held-out movements.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::statistics::ratio_and_error;
use crate::{
    Basis, Layout, Metric, MotionLibrary, Movement, Recordings, SampledSpring, Trajectory, Truncation,
};

/// Errors of one basis with a given number of weights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Number of weights.
    pub n: usize,
    /// Root mean square of the residual forces, relative to the root mean square of the forces.
    pub force: f64,
    /// Standard error of `force` over the movements.
    pub force_error: f64,
    /// Errors of the resulting paths.
    pub position: PathError,
}

/// Statistics of path errors. The error of a path is the root mean square over its samples, relative to the
/// mean spread of all paths.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PathError {
    /// Mean error over the movements.
    pub mean: f64,
    /// Standard deviation of the error over the movements.
    pub deviation: f64,
    /// Median error over the movements.
    pub median: f64,
    /// Largest error of any movement.
    pub worst: f64,
}

impl PathError {
    /// Computes the statistics from one error per movement.
    pub fn from_errors(mut errors: Vec<f64>) -> Self {
        let n = errors.len().max(1) as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n).sqrt();
        errors.sort_by(f64::total_cmp);
        let median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        Self { mean, deviation, median, worst: errors.last().copied().unwrap_or(0.0) }
    }
}

/// Returns the forces of recordings, one per column, and their frames.
pub(super) fn forces_of(
    recordings: &Recordings,
    spring: &SampledSpring,
) -> (DMatrix<f64>, Vec<super::Frame>) {
    let rows = recordings.names.len() * spring.forces();
    let mut forces = DMatrix::zeros(rows, recordings.trajectories.len());
    let mut frames = Vec::new();
    for (k, trajectory) in recordings.trajectories.iter().enumerate() {
        let movement = Movement::from_trajectory(trajectory, spring);
        forces.column_mut(k).copy_from_slice(&movement.forces);
        frames.push(movement.frame);
    }
    (forces, frames)
}

/// Computes the errors with which a basis approximates recordings: the errors of the forces, and the errors
/// of the paths that the spring follows under the approximated forces.
pub fn evaluate(basis: &Basis, recordings: &Recordings, spring: &SampledSpring) -> Evaluation {
    let (forces, _) = forces_of(recordings, spring);
    let left = &forces - basis.approximate(&forces);
    let dofs = recordings.names.len();
    let errors = path_errors(left.clone(), dofs, spring);
    let spread = mean_spread(recordings, spring);
    let squares = |matrix: &DMatrix<f64>| -> Vec<f64> {
        matrix.column_iter().map(|column| column.norm_squared()).collect()
    };
    let (ratio, error) = ratio_and_error(&squares(&left), &squares(&forces));
    let force = ratio.sqrt();
    Evaluation {
        n: basis.size(),
        force,
        // the derivative of the root
        force_error: if force > 0.0 { 0.5 * error / force } else { 0.0 },
        position: PathError::from_errors(errors.into_iter().map(|error| error / spread).collect()),
    }
}

/// Returns one error per column of residual forces: the root mean square, over the samples, of the path that
/// these forces cause.
pub fn path_errors(mut left: DMatrix<f64>, dofs: usize, spring: &SampledSpring) -> Vec<f64> {
    let each = spring.forces();
    left.column_iter_mut()
        .map(|mut column| {
            let mut squares = 0.0;
            for block in column.as_mut_slice().chunks_exact_mut(each).take(dofs) {
                spring.respond(block);
                squares += block.iter().map(|y| y * y).sum::<f64>();
            }
            (squares / spring.samples() as f64).sqrt()
        })
        .collect()
}

/// Returns the mean spread of recordings.
fn mean_spread(recordings: &Recordings, spring: &SampledSpring) -> f64 {
    let spreads = recordings.trajectories.iter().map(|t| Trajectory::spread(&t.sampled(spring)));
    spreads.sum::<f64>() / recordings.trajectories.len().max(1) as f64
}

/// Returns the fraction of labelled recordings that nearest-neighbour search recognises: the nearest movement
/// of the library, in the first `n` weights, has the same label.
pub fn nearest_neighbour_rate(library: &MotionLibrary, recordings: &Recordings, n: usize) -> f64 {
    let mut recogniser = super::Recogniser::new(library, n);
    let mut right = 0;
    let labelled: Vec<&Trajectory> = recordings.trajectories.iter().filter(|t| t.label.is_some()).collect();
    for trajectory in &labelled {
        let movement = Movement::from_trajectory(trajectory, library.spring());
        recogniser.project(&movement.forces);
        let found = recogniser.nearest().and_then(|(k, _)| library.entries()[k].label.as_ref());
        right += usize::from(found == trajectory.label.as_ref());
    }
    right as f64 / labelled.len().max(1) as f64
}

/// Basis name of the [balanced](MotionLibrary::balanced) eigenforces in [`compare`].
pub const BALANCED: &str = "eigenforces, balanced";

/// Compares eigenforces, Fourier functions and kernels for each number of weights. Returns pairs of basis
/// name and evaluation. A library in the metric of position is evaluated twice, the second time balanced for
/// each number of weights. `done` is called after each number of weights.
pub fn compare(
    libraries: &[(&'static str, &MotionLibrary)],
    recordings: &Recordings,
    eigenforces: &[usize],
    mut done: impl FnMut(),
) -> Vec<(&'static str, Evaluation)> {
    let mut found = Vec::new();
    let Some((_, first)) = libraries.first() else { return found };
    let (layout, spring): (&Layout, &SampledSpring) = (first.layout(), first.spring());
    for &n in eigenforces {
        for (name, library) in libraries {
            found.push((*name, evaluate(&Basis::eigenforces(library, n), recordings, spring)));
            if library.metric() == Metric::Position
                && let Ok(balanced) = library.balanced(n, Truncation::Rank(n))
            {
                found.push((BALANCED, evaluate(&Basis::eigenforces(&balanced, n), recordings, spring)));
            }
        }
        if n >= layout.dofs() {
            found.push(("fourier", evaluate(&Basis::fourier(layout, spring, n), recordings, spring)));
            found.push(("kernels", evaluate(&Basis::kernels(layout, spring, n), recordings, spring)));
        }
        done();
    }
    found
}
