//! Policy search on library weights and on kernel weights.

use motorium_learners::{Power, PowerSettings};
use motorium_library::{MotionLibrary, Movement, Recordings, SampledSpring, Trajectory, kernel_functions};
use nalgebra::DMatrix;

use super::letters::chart;
use super::sheet::{Sheet, mean};
use crate::chart::Series;

const ROLLOUTS: usize = 300;
/// Rollouts at which the best reward is shown.
const SHOWN: [usize; 7] = [1, 10, 30, 60, 100, 200, 300];
/// Standard deviation of the first exploration, in those of the weights in the library.
const EXPLORATION: f64 = 0.6;
/// Factors on the exploration of which each row gets the one that is best for it: all rows are as optimistic.
const FACTORS: [f64; 5] = [0.05, 0.15, 0.4, 1.0, 2.0];

/// How kernels are explored at first. The library knows how much each of its weights varies; kernels are given as much.
#[derive(Clone, Copy)]
enum Prior {
    /// Each kernel with the same share of the squared force of the movements.
    Force,
    /// Each with the same share of the squared response.
    Response,
    /// Each as its weight varies in a ridge fit of the movements known to the library.
    Fit,
}

/// Functions to search with, and the variance of exploration for each weight.
pub(super) struct Space {
    pub(super) functions: DMatrix<f64>,
    pub(super) variance: Vec<f64>,
}

impl Space {
    /// The first eigenforces, explored as much as their weights vary in the library.
    pub(super) fn library(library: &MotionLibrary, n: usize, movements: usize) -> Self {
        let n = n.min(library.rank());
        let variance = library.parts().singular[..n].iter();
        Self {
            functions: library.eigenforces().columns(0, n).into_owned(),
            variance: variance.map(|s| EXPLORATION.powi(2) * s * s / movements.max(1) as f64).collect(),
        }
    }

    /// The kernels of each degree of freedom, explored as a prior says.
    fn kernels(library: &MotionLibrary, n: usize, prior: Prior) -> Self {
        let (dofs, spring) = (library.layout().dofs(), library.spring());
        let (each, steps) = ((n / dofs).max(1), spring.forces());
        let kernels = kernel_functions(spring, each);
        let mut functions = DMatrix::zeros(library.rows(), each * dofs);
        for d in 0..dofs {
            functions.view_mut((d * steps, d * each), kernels.shape()).copy_from(&kernels);
        }
        let movements = library.entries().len().max(1) as f64;
        let data = library.eigenforces() * library.weights();
        // squared force (or response) of the movements and of every function
        let respond = |matrix: &DMatrix<f64>| {
            let mut matrix = matrix.clone();
            matrix.as_mut_slice().chunks_exact_mut(steps).for_each(|block| spring.respond(block));
            matrix
        };
        let shared = |data: &DMatrix<f64>, functions: &DMatrix<f64>| -> Vec<f64> {
            let share = data.norm_squared() / movements / functions.ncols() as f64;
            functions.column_iter().map(|f| share / f.norm_squared().max(f64::MIN_POSITIVE)).collect()
        };
        let variance = match prior {
            Prior::Force => shared(&data, &functions),
            Prior::Response => shared(&respond(&data), &respond(&functions)),
            Prior::Fit => {
                // the weights of every movement, by ridge regression of its path
                let responses = respond(&functions);
                let mut gram = responses.tr_mul(&responses);
                let ridge = 1e-6 * gram.trace() / gram.nrows() as f64;
                (0..gram.nrows()).for_each(|k| gram[(k, k)] += ridge);
                let weights = gram
                    .cholesky()
                    .map(|factor| factor.solve(&responses.tr_mul(&respond(&data))))
                    .unwrap_or_else(|| DMatrix::zeros(functions.ncols(), 1));
                weights.row_iter().map(|row| row.norm_squared() / movements).collect()
            }
        };
        let variance = variance.into_iter().map(|v| EXPLORATION.powi(2) * v).collect();
        Self { variance, functions }
    }

    /// The same functions, explored more or less.
    fn explored(&self, factor: f64) -> Self {
        let variance = self.variance.iter().map(|variance| factor * factor * variance).collect();
        Self { functions: self.functions.clone(), variance }
    }

    /// The best reward after each number of rollouts shown: `exp(-3 e^2)`, `e` the error of position over the spread.
    pub(super) fn search(
        &self,
        goal: &[f64],
        spread: f64,
        spring: &SampledSpring,
        seed: u64,
    ) -> [f64; SHOWN.len()] {
        let mut power =
            Power::new(vec![0.0; self.variance.len()], self.variance.clone(), PowerSettings::default(), seed);
        let mut shown = [0.0; SHOWN.len()];
        let mut left = vec![0.0; goal.len()];
        let simd = motorium_library::algebra::Simd::new();
        for rollout in 1..=ROLLOUTS {
            left.iter_mut().zip(goal).for_each(|(left, goal)| *left = -goal);
            simd.superpose(self.functions.as_slice(), power.propose(), &mut left);
            left.chunks_exact_mut(spring.forces()).for_each(|block| spring.respond(block));
            let squared = left.iter().map(|y| y * y).sum::<f64>() / spring.samples() as f64;
            power.tell((-3.0 * squared / (spread * spread)).exp());
            if let Some(k) = SHOWN.iter().position(|shown| *shown == rollout) {
                shown[k] = power.best().map_or(0.0, |(_, reward)| reward);
            }
        }
        shown
    }
}

/// Searches over several goals: at each rollout shown, the mean and its standard error; and all final rewards.
pub(super) fn searches(
    space: &Space,
    goals: &[(Vec<f64>, f64)],
    spring: &SampledSpring,
    seeds: u64,
) -> (Vec<[f64; 3]>, Vec<f64>) {
    let mut all = Vec::new();
    for (k, (goal, spread)) in goals.iter().enumerate() {
        all.extend((0..seeds).map(|seed| space.search(goal, *spread, spring, 1000 * k as u64 + seed)));
    }
    let points = SHOWN.iter().enumerate().map(|(k, rollout)| {
        let rewards: Vec<f64> = all.iter().map(|run| run[k]).collect();
        let (mean, error) = mean(&rewards);
        [*rollout as f64, mean, error]
    });
    (points.collect(), all.iter().map(|run| run[SHOWN.len() - 1]).collect())
}

/// Mean final reward and its standard error, by a number of weights.
struct Found {
    n: usize,
    library: (f64, f64),
    kernels: (f64, f64),
    /// What the kernels were explored by.
    prior: &'static str,
}

impl Found {
    fn library_wins(&self) -> bool {
        self.library.0 - self.kernels.0 > self.library.1.hypot(self.kernels.1)
    }

    fn words(&self) -> String {
        let Self { n, library: l, kernels: k, prior } = self;
        format!("n = {n}: library {:.3} +- {:.3}, {prior} {:.3} +- {:.3}", l.0, l.1, k.0, k.1)
    }
}

pub(super) fn figure(
    sheet: &mut Sheet,
    library: &MotionLibrary,
    held: &Recordings,
    searched: usize,
) -> anyhow::Result<()> {
    let spring = *library.spring();
    let stride = (held.trajectories.len() / searched.max(1)).max(1);
    let goals: Vec<(Vec<f64>, f64)> = held
        .trajectories
        .iter()
        .step_by(stride)
        .take(searched)
        .map(|letter| {
            let spread = Trajectory::spread(&letter.resampled(spring.samples()));
            (Movement::of(letter, &spring).forces, spread)
        })
        .collect();
    let mut series = Vec::new();
    let mut finals = Vec::new();
    for n in [4, 8, 16, 32, 64] {
        let spaces = [
            ("library", Space::library(library, n, library.entries().len())),
            ("kernels, equal force", Space::kernels(library, n, Prior::Force)),
            ("kernels, equal response", Space::kernels(library, n, Prior::Response)),
            ("kernels, as fitted", Space::kernels(library, n, Prior::Fit)),
        ];
        let mut found = Vec::new();
        for (name, space) in spaces {
            let runs = FACTORS.map(|factor| searches(&space.explored(factor), &goals, &spring, 3));
            let best = runs.into_iter().max_by(|a, b| mean(&a.1).0.total_cmp(&mean(&b.1).0));
            let (points, last) = best.unwrap_or_default();
            series.push(Series { name: format!("{name}, n = {n}"), points });
            found.push((name, mean(&last)));
        }
        let (prior, kernels) =
            found[1..].iter().copied().max_by(|a, b| a.1.0.total_cmp(&b.1.0)).unwrap_or(found[0]);
        finals.push(Found { n, library: found[0].1, kernels, prior });
        sheet.bar.inc(1);
    }
    let title = "Policy search (PoWER) for held-out letters";
    sheet.chart("power-letters", &chart(title, ["rollouts", "best reward"], [true, false], series))?;
    let of = |n: &[usize]| finals.iter().filter(|f| n.contains(&f.n)).collect::<Vec<_>>();
    let wins = |n: &[usize]| of(n).iter().all(|found| found.library_wins());
    let words = |n: &[usize]| of(n).iter().map(|found| found.words()).collect::<Vec<_>>().join("; ");
    let claim = "with few weights, search in the library finds better movements than in kernels";
    sheet.claim("policy search", claim, wins(&[4, 8, 16]), words(&[4, 8, 16]));
    let claim = "with many weights, search in the library finds better movements than in kernels";
    let how = "the best of three priors for kernels and of five scales for each";
    sheet.claim("policy search", claim, wins(&[32, 64]), format!("{}; {how}", words(&[32, 64])));
    Ok(())
}
