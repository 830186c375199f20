//! Policy search (PoWER) on weights of a motion library and of radial kernels.

use motorium_algebra::Simd;
use motorium_library::statistics::mean_and_error;
use motorium_library::{MotionLibrary, Movement, SampledSpring, Trajectory, kernel_functions};
use nalgebra::DMatrix;

use crate::search::{Power, PowerSettings, Search as _, Start};

/// Number of rollouts of a search.
pub const ROLLOUTS: usize = 300;
/// Numbers of rollouts after which the best reward is reported.
pub const REPORTED: [usize; 7] = [1, 10, 30, 60, 100, 200, 300];
/// Standard deviation of the initial exploration, in standard deviations of the library's weights.
const EXPLORATION: f64 = 0.6;
/// Exploration scales tried by [`Search::best_scale`], so that every search space is tuned equally.
const SCALES: [f64; 5] = [0.05, 0.15, 0.4, 1.0, 2.0];
/// Searches for each goal, with different seeds.
const SEEDS: u64 = 3;

/// A movement that a search is to reproduce.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Forces of the movement, stored degree of freedom by degree of freedom.
    pub forces: Vec<f64>,
    /// Spread of the path, which is the unit of errors.
    pub spread: f64,
}

impl Goal {
    /// Creates a goal from a recorded movement.
    pub fn new(trajectory: &Trajectory, spring: &SampledSpring) -> Self {
        let spread = Trajectory::spread(&trajectory.sampled(spring));
        Self { forces: Movement::from_trajectory(trajectory, spring).forces, spread }
    }
}

/// Initial exploration of kernel weights. A library provides the variance of each of its weights. The
/// variances of the kernels have the same sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelPrior {
    /// Each kernel contributes equally to the squared force of the movements.
    EqualForce,
    /// Each kernel contributes equally to the squared response of the movements.
    EqualResponse,
    /// The weight of each kernel has the variance of a ridge fit to the library's movements.
    Fitted,
}

/// Basis functions of a search, and the variance with which the weight of each function is explored.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSpace {
    /// Basis functions, forces x weights.
    pub functions: DMatrix<f64>,
    /// Variance of the initial exploration of each weight.
    pub variance: Vec<f64>,
}

impl SearchSpace {
    /// Returns a space of the first `n` eigenforces. Each weight is explored with the variance that it has in
    /// the movements of the library.
    pub fn library(library: &MotionLibrary, n: usize) -> Self {
        Self::library_of(library, n, library.entries().len())
    }

    /// Returns a space of the first `n` eigenforces of a library that represents `movements` movements. The
    /// library does not have to contain weights, so it may be merged from independently moving parts, for
    /// example.
    pub fn library_of(library: &MotionLibrary, n: usize, movements: usize) -> Self {
        let n = n.min(library.rank());
        let movements = movements.max(1) as f64;
        let variance = library.parts().singular[..n].iter();
        Self {
            functions: library.eigenforces().columns(0, n).into_owned(),
            variance: variance.map(|s| EXPLORATION.powi(2) * s * s / movements).collect(),
        }
    }

    /// Returns a space of `n` radial kernels, divided among all degrees of freedom.
    pub fn kernels(library: &MotionLibrary, n: usize, prior: KernelPrior) -> Self {
        let (dofs, spring) = (library.layout().dofs(), library.spring());
        let (each, steps) = ((n / dofs).max(1), spring.forces());
        let kernels = kernel_functions(spring, each);
        let mut functions = DMatrix::zeros(library.rows(), each * dofs);
        for d in 0..dofs {
            functions.view_mut((d * steps, d * each), kernels.shape()).copy_from(&kernels);
        }
        let movements = library.entries().len().max(1) as f64;
        let data = library.eigenforces() * library.weights();
        // squared force (or response) of the movements, relative to each function's
        let shared = |data: &DMatrix<f64>, functions: &DMatrix<f64>| -> Vec<f64> {
            let share = data.norm_squared() / movements / functions.ncols() as f64;
            functions.column_iter().map(|f| share / f.norm_squared().max(f64::MIN_POSITIVE)).collect()
        };
        let variance = match prior {
            KernelPrior::EqualForce => shared(&data, &functions),
            KernelPrior::EqualResponse => shared(&respond(&data, spring), &respond(&functions, spring)),
            KernelPrior::Fitted => {
                let weights = fit(&functions, &data, spring);
                weights.row_iter().map(|row| row.norm_squared() / movements).collect()
            }
        };
        let variance = variance.into_iter().map(|v| EXPLORATION.powi(2) * v).collect();
        Self { variance, functions }
    }

    /// Simulates the movement of `spring` under `forces`. Returns the weights that best reproduce the path of
    /// this movement, by ridge regression.
    pub fn weights_of(&self, forces: &[f64], spring: &SampledSpring) -> Vec<f64> {
        let forces = DMatrix::from_column_slice(forces.len(), 1, forces);
        fit(&self.functions, &forces, spring).as_slice().to_vec()
    }

    /// Returns the space with the standard deviations of the exploration scaled by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let variance = self.variance.iter().map(|variance| factor * factor * variance).collect();
        Self { functions: self.functions.clone(), variance }
    }

    /// Searches for the weights that reproduce a goal. Returns the best reward after each number of rollouts
    /// in [`REPORTED`]. The reward is `exp(-3 e^2)`, where `e` is the position error divided by the spread of
    /// the goal.
    pub fn search(&self, goal: &Goal, spring: &SampledSpring, seed: u64) -> [f64; REPORTED.len()] {
        let deviation = self.variance.iter().map(|variance| variance.max(0.0).sqrt()).collect();
        let start = Start::new(vec![0.0; self.variance.len()], deviation, seed);
        let Ok(mut power) = Power::new(start, PowerSettings::default()) else {
            return [0.0; REPORTED.len()];
        };
        let mut reported = [0.0; REPORTED.len()];
        let mut left = vec![0.0; goal.forces.len()];
        let simd = Simd::new();
        for rollout in 1..=ROLLOUTS {
            left.iter_mut().zip(&goal.forces).for_each(|(left, goal)| *left = -goal);
            let candidate = power.ask(1).pop().expect("a candidate once the last has its reward");
            simd.superpose(self.functions.as_slice(), &candidate.parameters, &mut left);
            left.chunks_exact_mut(spring.forces()).for_each(|block| spring.respond(block));
            let squared = left.iter().map(|y| y * y).sum::<f64>() / spring.samples() as f64;
            let reward = (-3.0 * squared / (goal.spread * goal.spread)).exp();
            power.tell(&[(candidate.id, reward)]).expect("a candidate without a reward");
            if let Some(k) = REPORTED.iter().position(|reported| *reported == rollout) {
                reported[k] = power.best().map_or(0.0, |(_, reward)| reward);
            }
        }
        reported
    }
}

/// Returns the paths of columns of forces, without their first samples.
fn respond(forces: &DMatrix<f64>, spring: &SampledSpring) -> DMatrix<f64> {
    let mut paths = forces.clone();
    paths.as_mut_slice().chunks_exact_mut(spring.forces()).for_each(|block| spring.respond(block));
    paths
}

/// Returns the weights of functions for columns of forces, by ridge regression of the paths.
fn fit(functions: &DMatrix<f64>, forces: &DMatrix<f64>, spring: &SampledSpring) -> DMatrix<f64> {
    let responses = respond(functions, spring);
    let mut gram = responses.tr_mul(&responses);
    let ridge = 1e-6 * gram.trace() / gram.nrows() as f64;
    (0..gram.nrows()).for_each(|k| gram[(k, k)] += ridge);
    gram.cholesky()
        .map(|factor| factor.solve(&responses.tr_mul(&respond(forces, spring))))
        .unwrap_or_else(|| DMatrix::zeros(functions.ncols(), forces.ncols()))
}

/// Rewards of searches for several goals with several seeds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Search {
    /// Best rewards. Each row is a search, and each column is an entry of [`REPORTED`].
    pub rewards: Vec<[f64; REPORTED.len()]>,
}

impl Search {
    /// Runs three searches with different seeds for every goal.
    pub fn new(space: &SearchSpace, goals: &[Goal], spring: &SampledSpring) -> Self {
        let mut rewards = Vec::new();
        for (k, goal) in goals.iter().enumerate() {
            rewards.extend((0..SEEDS).map(|seed| space.search(goal, spring, 1000 * k as u64 + seed)));
        }
        Self { rewards }
    }

    /// Runs searches with five exploration scales, and returns the result with the largest mean final reward.
    pub fn best_scale(space: &SearchSpace, goals: &[Goal], spring: &SampledSpring) -> Self {
        let all = SCALES.map(|scale| Self::new(&space.scaled(scale), goals, spring));
        let best = all.into_iter().max_by(|a, b| a.reward().0.total_cmp(&b.reward().0));
        best.unwrap_or_default()
    }

    /// Returns, for each entry of [`REPORTED`], the number of rollouts, the mean of the best rewards so far,
    /// and the standard error of this mean.
    pub fn curve(&self) -> Vec<[f64; 3]> {
        let point = |(k, rollouts): (usize, &usize)| {
            let rewards: Vec<f64> = self.rewards.iter().map(|run| run[k]).collect();
            let (mean, error) = mean_and_error(&rewards);
            [*rollouts as f64, mean, error]
        };
        REPORTED.iter().enumerate().map(point).collect()
    }

    /// Returns the mean reward of the best candidates at the end of the searches, and the standard error of
    /// this mean.
    pub fn reward(&self) -> (f64, f64) {
        let last: Vec<f64> = self.rewards.iter().map(|run| run[REPORTED.len() - 1]).collect();
        mean_and_error(&last)
    }
}

/// Returns `true` if the mean of `a` exceeds the mean of `b` by more than the standard error of their
/// difference. `a` and `b` consist of a mean and its standard error.
pub fn is_clearly_larger(a: (f64, f64), b: (f64, f64)) -> bool {
    a.0 - b.0 > a.1.hypot(b.1)
}
