//! CMA-ES: covariance matrix adaptation evolution strategy.

use std::collections::VecDeque;

use motorium_algebra::symmetric_eigen;
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Restart strategy of [`CmaEs`] after a run has converged or stalled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Restarts {
    /// No restarts: the search stays at its point of convergence.
    Never,
    /// Two kinds of restarts with equal budgets: restarts that double the population, and restarts with a
    /// small population and small initial deviations.
    #[default]
    Bipop,
}

/// Settings of [`CmaEs`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CmaEsSettings {
    /// Number of candidates per generation, at least 4. Default `4 + floor(3 ln n)` for `n` parameters.
    pub population: Option<usize>,
    /// Restart strategy. Default [`Restarts::Bipop`].
    pub restarts: Restarts,
}

/// A search that adapts the full covariance of its candidates (CMA-ES).
///
/// For the best `mu` of `lambda` candidates `x_i = m + sigma B D z_i`, `y_i = (x_i - m) / sigma`, `y_w = sum
/// w_i y_i`:
///
/// ```text
/// m'     = m + sigma y_w
/// p_s'   = (1 - c_s) p_s + sqrt(c_s (2 - c_s) mu_eff) C^-1/2 y_w
/// p_c'   = (1 - c_c) p_c + h sqrt(c_c (2 - c_c) mu_eff) y_w
/// C'     = (1 - c_1 - c_mu + (1 - h) c_1 c_c (2 - c_c)) C + c_1 p_c p_c^T + c_mu sum w_i y_i y_i^T
/// sigma' = sigma exp(c_s / d_s (|p_s| / chi_n - 1))
/// ```
///
/// `h` is 0 while `p_s` is long, and 1 otherwise. All constants are Hansen's defaults. The eigenvectors `B`
/// and the square roots of the eigenvalues `D` are computed every `0.5 / (n (c_1 + c_mu))` generations. A run
/// ends when one of these conditions is met: the rewards of `10 + ceil(30 n / lambda)` generations differ by
/// less than 1e-12; the deviations are below 1e-12 or above 1e4 times the initial deviation; the condition
/// number exceeds 1e14; or `100 + 50 (n + 3)^2 / sqrt(lambda)` generations have passed. The next run starts
/// at a point sampled from the initial distribution.
///
/// Sources: Hansen, *The CMA evolution strategy: a tutorial*, arXiv:1604.00772, 2016, with positive weights;
/// the period of the eigendecomposition after Hansen's `purecma`; Hansen, *Benchmarking a BI-population
/// CMA-ES on the BBOB-2009 function testbed*, GECCO 2009.
pub type CmaEs = Generations<Covariance>;

/// Search distribution of [`CmaEs`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Covariance {
    settings: CmaEsSettings,
    constants: Constants,
    mean: Vec<f64>,
    sigma: f64,
    /// Lower triangle, column by column.
    covariance: Vec<f64>,
    /// Eigenvectors, column by column, and square roots of the eigenvalues.
    vectors: Vec<f64>,
    roots: Vec<f64>,
    path_sigma: Vec<f64>,
    path_covariance: Vec<f64>,
    run: Run,
    restarts: Bipop,
}

/// Progress of one run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Run {
    generation: usize,
    /// Generation of the last eigendecomposition.
    decomposed: usize,
    /// Best rewards of the latest generations.
    history: VecDeque<f64>,
    /// Initial deviation.
    sigma: f64,
    evaluations: usize,
    /// Number of evaluations after which a run with a small population ends.
    budget: Option<usize>,
}

/// State of the restarts.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Bipop {
    /// Number of restarts with large populations.
    doublings: u32,
    /// Numbers of evaluations of runs with large and with small populations.
    large: usize,
    small: usize,
    /// Number of evaluations of the last run with a large population.
    last_large: usize,
}

/// Constants of a run, with the names of the tutorial.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Constants {
    lambda: usize,
    weights: Vec<f64>,
    mu_eff: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    chi: f64,
    /// Generations between two eigendecompositions.
    gap: f64,
}

impl Constants {
    fn new(dimensions: usize, lambda: usize) -> Self {
        let n = dimensions as f64;
        let mu = lambda / 2;
        let raw: Vec<f64> = (1..=mu).map(|i| ((lambda as f64 + 1.0) / 2.0).ln() - (i as f64).ln()).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        let mu_eff = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n);
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff);
        let c_mu = (2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0).powi(2) + mu_eff)).min(1.0 - c_1);
        let chi = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        let gap = 0.5 / (n * (c_1 + c_mu));
        Self { lambda, weights, mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi, gap }
    }
}

/// Returns the default number of candidates per generation for evolution strategies.
pub(super) fn default_population(dimensions: usize) -> usize {
    4 + (3.0 * (dimensions as f64).ln()).floor() as usize
}

impl CmaEs {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: CmaEsSettings) -> Result<Self, StartError> {
        if let Some(population) = settings.population {
            StartError::check("population", population as f64, population >= 4, "at least 4")?;
        }
        Self::build(start, |start| Ok(Covariance::new(start.dimensions(), settings)))
    }
}

impl Covariance {
    fn new(n: usize, settings: CmaEsSettings) -> Self {
        let population = settings.population.unwrap_or_else(|| default_population(n));
        let mut made = Self {
            settings,
            constants: Constants::new(n, population),
            mean: vec![0.0; n],
            sigma: 1.0,
            covariance: vec![],
            vectors: vec![],
            roots: vec![],
            path_sigma: vec![],
            path_covariance: vec![],
            run: Run::default(),
            restarts: Bipop::default(),
        };
        made.reset(1.0, None);
        made
    }

    /// Starts a run at the mean with an isotropic covariance.
    fn reset(&mut self, sigma: f64, budget: Option<usize>) {
        let n = self.mean.len();
        let mut identity = vec![0.0; n * n];
        identity.iter_mut().step_by(n + 1).for_each(|entry| *entry = 1.0);
        self.sigma = sigma;
        self.vectors = identity.clone();
        self.covariance = identity;
        self.roots = vec![1.0; n];
        self.path_sigma = vec![0.0; n];
        self.path_covariance = vec![0.0; n];
        self.run = Run { sigma, budget, ..Run::default() };
    }

    /// Returns the step size. The standard deviation along a principal axis is the step size times the square
    /// root of the axis's eigenvalue.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Returns `C^-1/2 x`.
    fn whiten(&self, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        let mut out = vec![0.0; n];
        for (axis, root) in self.vectors.chunks_exact(n).zip(&self.roots) {
            let factor = dot(axis, x) / root;
            out.iter_mut().zip(axis).for_each(|(out, axis)| *out += factor * axis);
        }
        out
    }

    fn decompose(&mut self) {
        let n = self.mean.len();
        let found = symmetric_eigen(DMatrix::from_column_slice(n, n, &self.covariance));
        // rounding may cause tiny negative eigenvalues
        let least = found.values[0].max(f64::MIN_POSITIVE) * 1e-20;
        self.roots.clear();
        self.roots.extend(found.values.iter().map(|value| value.max(least).sqrt()));
        self.vectors.copy_from_slice(found.vectors.as_slice());
        self.run.decomposed = self.run.generation;
    }

    fn has_ended(&self) -> bool {
        let Self { constants: Constants { lambda, .. }, run, sigma, .. } = self;
        let n = self.mean.len();
        let limit = 100.0 + 50.0 * (n as f64 + 3.0).powi(2) / (*lambda as f64).sqrt();
        let horizon = 10 + (30 * n).div_ceil(*lambda);
        let is_flat = run.history.len() == horizon && {
            let (low, high) =
                run.history.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), reward| {
                    (low.min(*reward), high.max(*reward))
                });
            high - low < 1e-12
        };
        let deviation =
            |i: usize| sigma * self.covariance[i * n + i].max(0.0).sqrt().max(self.path_covariance[i].abs());
        let is_small = (0..n).all(|i| deviation(i) < 1e-12 * run.sigma);
        let largest = self.roots.iter().fold(0.0_f64, |most, root| most.max(*root));
        let smallest = self.roots.iter().fold(f64::INFINITY, |least, root| least.min(*root));
        run.generation as f64 >= limit
            || is_flat
            || is_small
            || sigma * largest > 1e4 * run.sigma
            || (largest / smallest).powi(2) > 1e14
            || run.budget.is_some_and(|budget| run.evaluations >= budget)
    }

    fn restart(&mut self, random: &mut Pcg64) {
        let n = self.mean.len();
        let evaluations = self.run.evaluations;
        if self.run.budget.is_some() {
            self.restarts.small += evaluations;
        } else {
            self.restarts.large += evaluations;
            self.restarts.last_large = evaluations;
        }
        let default = self.settings.population.unwrap_or_else(|| default_population(n));
        self.mean.iter_mut().for_each(|mean| *mean = StandardNormal.sample(random));
        let large = |doublings: u32| default << doublings.min(16);
        if self.restarts.small < self.restarts.large && self.restarts.doublings > 0 {
            let exponent: f64 = random.random();
            let ratio = 0.5 * large(self.restarts.doublings) as f64 / default as f64;
            let lambda = (default as f64 * ratio.powf(exponent * exponent)).floor() as usize;
            let shrink: f64 = random.random();
            let sigma = 10.0_f64.powf(-2.0 * shrink);
            self.constants = Constants::new(n, lambda.max(4));
            self.reset(sigma, Some(self.restarts.last_large / 2));
        } else {
            self.restarts.doublings += 1;
            self.constants = Constants::new(n, large(self.restarts.doublings));
            self.reset(1.0, None);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Distribution for Covariance {
    const METHOD: &'static str = "cma-es";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.constants.lambda
    }

    fn sample(&mut self, _: usize, random: &mut Pcg64, point: &mut [f64]) {
        point.copy_from_slice(&self.mean);
        for (axis, root) in self.vectors.chunks_exact(self.mean.len()).zip(&self.roots) {
            let noise: f64 = StandardNormal.sample(random);
            let length = self.sigma * root * noise;
            point.iter_mut().zip(axis).for_each(|(x, axis)| *x += length * axis);
        }
    }

    fn update(&mut self, samples: &Samples<'_>, random: &mut Pcg64) {
        let n = self.mean.len();
        let Constants { lambda, ref weights, mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi, gap } =
            self.constants;
        self.run.generation += 1;
        self.run.evaluations += samples.rewards.len();
        let mu = weights.len().min(samples.rewards.len());
        let mut steps = Vec::with_capacity(mu * n);
        for index in &samples.order[..mu] {
            let step = samples.point(*index).iter().zip(&self.mean).map(|(x, m)| (x - m) / self.sigma);
            steps.extend(step);
        }
        let mut mean_step = vec![0.0; n];
        for (step, weight) in steps.chunks_exact(n).zip(weights) {
            mean_step.iter_mut().zip(step).for_each(|(sum, step)| *sum += weight * step);
        }
        let whitened = self.whiten(&mean_step);
        self.mean.iter_mut().zip(&mean_step).for_each(|(mean, step)| *mean += self.sigma * step);
        let gain = (c_sigma * (2.0 - c_sigma) * mu_eff).sqrt();
        for (path, step) in self.path_sigma.iter_mut().zip(&whitened) {
            *path = (1.0 - c_sigma) * *path + gain * step;
        }
        let length = dot(&self.path_sigma, &self.path_sigma).sqrt();
        let settled = (1.0 - (1.0 - c_sigma).powi(2 * self.run.generation as i32)).sqrt();
        let h = if length / settled < (1.4 + 2.0 / (n as f64 + 1.0)) * chi { 1.0 } else { 0.0 };
        let gain = h * (c_c * (2.0 - c_c) * mu_eff).sqrt();
        for (path, step) in self.path_covariance.iter_mut().zip(&mean_step) {
            *path = (1.0 - c_c) * *path + gain * step;
        }
        let keep = 1.0 - c_1 - c_mu + (1.0 - h) * c_1 * c_c * (2.0 - c_c);
        for (j, column) in self.covariance.chunks_exact_mut(n).enumerate() {
            let column = &mut column[j..];
            let path = &self.path_covariance[j..];
            let factor = c_1 * path[0];
            column.iter_mut().zip(path).for_each(|(entry, path)| *entry = keep * *entry + factor * path);
            for (step, weight) in steps.chunks_exact(n).zip(weights) {
                let factor = c_mu * weight * step[j];
                column.iter_mut().zip(&step[j..]).for_each(|(entry, step)| *entry += factor * step);
            }
        }
        let growth = (c_sigma / d_sigma * (length / chi - 1.0)).min(1.0).exp();
        self.sigma = (self.sigma * growth).clamp(1e-150, 1e150);
        if (self.run.generation - self.run.decomposed) as f64 > gap {
            self.decompose();
        }
        let horizon = 10 + (30 * n).div_ceil(lambda);
        self.run.history.push_back(samples.rewards[samples.order[0]]);
        if self.run.history.len() > horizon {
            self.run.history.pop_front();
        }
        if self.settings.restarts == Restarts::Bipop && self.has_ended() {
            self.restart(random);
        }
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Search as _, tests::rollouts};
    use super::*;
    use rand::SeedableRng as _;

    fn search(n: usize, seed: u64, settings: CmaEsSettings) -> CmaEs {
        CmaEs::new(Start::new(vec![3.0; n], vec![1.0; n], seed), settings).expect("a search")
    }

    #[test]
    fn constants_match_the_reference_implementation() {
        // PyPI cma 4.5.0, CMAEvolutionStrategy(10 * [0], 1, {'CMA_active': False})
        let found = Constants::new(10, 10);
        let expected = [
            (found.mu_eff, 3.167_299_281_410_701_7),
            (found.weights[0], 0.456_272_646_903_405_97),
            (found.weights[4], 0.025_509_591_835_974_777),
            (found.c_1, 0.015_283_824_524_751_714),
            (found.c_c, 0.294_990_383_035_622_25),
            (found.chi, 3.084_726_565_169_012_3),
        ];
        for (found, expected) in expected {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert_eq!((default_population(10), default_population(50)), (10, 15));
    }

    #[test]
    fn one_update_equals_the_equations() {
        // two dimensions, identity covariance, four candidates
        let mut found = Covariance::new(2, CmaEsSettings { population: Some(4), ..Default::default() });
        let points = [1.0, 0.0, 0.0, 2.0, -1.0, 0.0, 0.0, -1.0];
        let samples = Samples { points: &points, rewards: &[4.0, 3.0, 2.0, 1.0], order: &[0, 1, 2, 3] };
        found.update(&samples, &mut Pcg64::seed_from_u64(0));
        let c = Constants::new(2, 4);
        let [w1, w2] = [c.weights[0], c.weights[1]];
        let mean = [w1, 2.0 * w2];
        let gain = (c.c_sigma * (2.0 - c.c_sigma) * c.mu_eff).sqrt();
        let length = gain * mean[0].hypot(mean[1]);
        let sigma = (c.c_sigma / c.d_sigma * (length / c.chi - 1.0)).exp();
        let path = (c.c_c * (2.0 - c.c_c) * c.mu_eff).sqrt();
        let keep = 1.0 - c.c_1 - c.c_mu;
        let first = keep + c.c_1 * (path * mean[0]).powi(2) + c.c_mu * w1;
        let off = c.c_1 * path * path * mean[0] * mean[1];
        let second = keep + c.c_1 * (path * mean[1]).powi(2) + c.c_mu * w2 * 4.0;
        for (found, expected) in [
            (found.mean[0], mean[0]),
            (found.mean[1], mean[1]),
            (found.sigma, sigma),
            (found.covariance[0], first),
            (found.covariance[1], off),
            (found.covariance[3], second),
        ] {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    #[test]
    fn rosenbrock_in_ten_dimensions_is_solved_in_8000_rollouts() {
        let value = |x: &[f64]| {
            -x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum::<f64>()
        };
        for seed in 1..4 {
            let mut search =
                search(10, seed, CmaEsSettings { restarts: Restarts::Never, ..Default::default() });
            rollouts(&mut search, 8000, value);
            let (best, reward) = search.best().expect("rewards");
            // the local optimum near -1 has a value of about 4
            assert!(reward > -1e-8 || (reward + 3.98).abs() < 0.1, "{best:?}: {reward}");
        }
    }

    #[test]
    fn ellipsoid_with_condition_1e6_is_descended() {
        let n = 10;
        let value = |x: &[f64]| {
            let terms = x.iter().enumerate();
            -terms.map(|(i, x)| 10.0_f64.powf(6.0 * i as f64 / (n - 1) as f64) * x * x).sum::<f64>()
        };
        let mut search = search(n, 1, CmaEsSettings { restarts: Restarts::Never, ..Default::default() });
        rollouts(&mut search, 8000, value);
        assert!(search.best().expect("rewards").1 > -1e-9, "{:?}", search.best());
    }

    #[test]
    fn restarts_leave_the_local_optima_of_rastrigin() {
        let value = |x: &[f64]| {
            let wave = |x: &f64| x * x - 10.0 * (std::f64::consts::TAU * x).cos() + 10.0;
            -x.iter().map(wave).sum::<f64>()
        };
        let start = || Start::new(vec![2.0; 3], vec![2.0; 3], 3).within(vec![[-5.0, 5.0]; 3]);
        let mut search = CmaEs::new(start(), CmaEsSettings::default()).expect("a search");
        rollouts(&mut search, 20_000, value);
        assert!(search.best().expect("rewards").1 > -1e-8, "{:?}", search.best());
        assert!(search.distribution().restarts.doublings > 0);
        assert!(search.distribution().restarts.small > 0, "{:?}", search.distribution().restarts);
    }
}
