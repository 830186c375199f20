//! Bayesian optimisation.

mod acquisition;

use std::collections::BTreeMap;
use std::sync::Arc;

use motorium_models::gp::{GaussianProcess, GpError, Scratch};
use motorium_models::kernel::Kernel;
use motorium_models::optimise::{Options, minimise};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

pub use acquisition::Acquisition;

use super::{Best, Candidate, RestoreError, Saved, Search, StartError, TellError, check_bounds};
use crate::random::{Counter, Purpose};

/// Name of the method in saved states.
const METHOD: &str = "bayesian-optimisation";
/// Bounds of the noise variance, in units of the variance of the rewards.
const NOISE: [f64; 2] = [1e-6, 1.0];

/// Expected smoothness of the rewards, which selects the kernel of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Smoothness {
    /// Matern kernel with `nu = 5/2`: twice differentiable.
    #[default]
    Matern52,
    /// Radial basis function kernel: infinitely differentiable.
    Rbf,
}

impl Smoothness {
    /// Returns the kernel with a length scale of 0.5 in each dimension.
    fn kernel(self, dimensions: usize) -> Kernel {
        match self {
            Self::Matern52 => Kernel::matern52(dimensions, 0.5),
            Self::Rbf => Kernel::rbf(dimensions, 0.5),
        }
    }
}

/// Settings of [`BayesianOptimisation`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BayesianSettings {
    /// Acquisition function. Default: expected improvement.
    pub acquisition: Acquisition,
    /// Kernel of the model. Default: Matern 5/2.
    #[serde(default)]
    pub smoothness: Smoothness,
    /// Number of quasi-random points before the first model, at least 1. Default 5.
    pub initial: usize,
    /// Number of points at which the acquisition function is evaluated before the local search, at least 1.
    /// Default 2000.
    pub points: usize,
    /// Number of local searches, at least 1. Each local search starts at one of the points with the largest
    /// acquisition. Default 5.
    pub starts: usize,
    /// Number of rewards between two fits of the hyperparameters, at least 1. Default 5. Between two fits,
    /// each reward is added to the model in `O(n^2)`.
    pub refit: usize,
}

impl Default for BayesianSettings {
    fn default() -> Self {
        Self {
            acquisition: Acquisition::default(),
            smoothness: Smoothness::default(),
            initial: 5,
            points: 2000,
            starts: 5,
            refit: 5,
        }
    }
}

/// A known constraint that returns `true` for feasible parameters.
type Feasible = Arc<dyn Fn(&[f64]) -> bool + Send + Sync>;

/// A search that models the reward by a Gaussian process and evaluates the point with the largest
/// [`Acquisition`].
///
/// The process has a Matern 5/2 kernel (or the kernel of another [`Smoothness`]) with one length scale per
/// parameter. Parameters are scaled to the unit box, and rewards are standardised. The hyperparameters
/// maximise the marginal likelihood with log-normal priors: length scales around 0.5 and a variance around 1,
/// both with a standard deviation of 1 in the logarithm. Simultaneous candidates are chosen one after the
/// other, each as if the pending candidates had returned their predicted mean.
///
/// Sources: Snoek, Larochelle, Adams, *Practical Bayesian optimization of machine learning algorithms*, NIPS
/// 2012; whole numbers after Garrido-Merchan, Hernandez-Lobato, *Dealing with categorical and integer-valued
/// variables in Bayesian optimization with Gaussian processes*, Neurocomputing 380, 2020; the quasi-random
/// sequence is the additive recurrence of the generalised golden ratio.
///
/// ```
/// use motorium_learners::search::{BayesianOptimisation, BayesianSettings, Search};
///
/// let bounds = vec![[-2.0, 3.0], [-1.0, 4.0]];
/// let mut search = BayesianOptimisation::new(bounds, BayesianSettings::default(), 1)?;
/// for _ in 0..30 {
///     for candidate in search.ask(1) {
///         let [x, y] = [candidate.parameters[0], candidate.parameters[1]];
///         search.tell(&[(candidate.id, -(x - 1.0).powi(2) - (y - 2.0).powi(2))])?;
///     }
/// }
/// assert!(search.best().expect("rewards").1 > -1e-2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Serialize, Deserialize)]
pub struct BayesianOptimisation {
    settings: BayesianSettings,
    bounds: Vec<[f64; 2]>,
    whole: Vec<bool>,
    seed: u64,
    /// Number of candidates so far.
    asked: u64,
    /// Candidates without rewards, in the unit box.
    pending: BTreeMap<u64, Vec<f64>>,
    /// Rewards that are not yet in the model.
    fresh: BTreeMap<u64, (Vec<f64>, Option<f64>)>,
    /// Points in the unit box and their rewards, in the order of their addition to the model.
    points: Vec<f64>,
    rewards: Vec<f64>,
    fit: Option<Fit>,
    best: Best,
    #[serde(skip)]
    process: Option<GaussianProcess>,
    #[serde(skip)]
    feasible: Option<Feasible>,
}

/// Hyperparameters and the standardisation of rewards, kept until the next fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Fit {
    /// Number of rewards at the time of the fit.
    count: usize,
    /// Logarithms of the kernel's parameters, then the noise variance.
    parameters: Vec<f64>,
    mean: f64,
    deviation: f64,
}

impl core::fmt::Debug for BayesianOptimisation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("BayesianOptimisation")
            .field("settings", &self.settings)
            .field("bounds", &self.bounds)
            .field("rewards", &self.rewards.len())
            .field("best", &self.best)
            .finish_non_exhaustive()
    }
}

impl BayesianOptimisation {
    /// Creates a search within bounds. There is one pair of bounds per parameter.
    ///
    /// # Errors
    ///
    /// [`StartError`] if bounds or settings are out of range.
    pub fn new(bounds: Vec<[f64; 2]>, settings: BayesianSettings, seed: u64) -> Result<Self, StartError> {
        check_bounds(&bounds)?;
        let BayesianSettings { acquisition, smoothness: _, initial, points, starts, refit } = settings;
        for (key, count) in [("initial", initial), ("points", points), ("starts", starts), ("refit", refit)] {
            StartError::check(key, count as f64, count > 0, "at least 1")?;
        }
        let parameter = acquisition.parameter();
        StartError::check("acquisition", parameter, parameter >= 0.0 && parameter.is_finite(), "at least 0")?;
        Ok(Self {
            settings,
            whole: vec![false; bounds.len()],
            bounds,
            seed,
            asked: 0,
            pending: BTreeMap::new(),
            fresh: BTreeMap::new(),
            points: vec![],
            rewards: vec![],
            fit: None,
            best: Best::default(),
            process: None,
            feasible: None,
        })
    }

    /// Restricts parameters to whole numbers; `whole` contains one flag per parameter. The model sees only
    /// rounded parameters.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the number of flags is wrong, or the bounds of a flagged parameter contain no whole
    /// number.
    pub fn with_whole_numbers(mut self, whole: Vec<bool>) -> Result<Self, StartError> {
        let expected = self.bounds.len();
        if whole.len() != expected {
            return Err(StartError::Count { what: "flags", found: whole.len(), expected });
        }
        for (index, ([low, high], _)) in self.bounds.iter().zip(&whole).enumerate().filter(|(_, (_, w))| **w)
        {
            if low.ceil() > high.floor() {
                let (what, expected) = ("the upper bound", "bounds that hold a whole number");
                return Err(StartError::Value { what, index, found: *high, expected });
            }
        }
        self.whole = whole;
        Ok(self)
    }

    /// Restricts candidates to parameters for which `feasible` returns `true`. The constraint is not part of
    /// saved states. If no sampled point is feasible, [`ask`](Search::ask) returns no candidate.
    #[must_use]
    pub fn with_constraint(mut self, feasible: impl Fn(&[f64]) -> bool + Send + Sync + 'static) -> Self {
        self.feasible = Some(Arc::new(feasible));
        self
    }

    /// Returns candidate `id` at a point in the unit box.
    fn candidate(&self, id: u64, unit: &[f64]) -> Candidate {
        let counter = Counter { seed: self.seed, step: id, ..Counter::default() };
        Candidate { id, parameters: self.parameters(unit), seed: counter.number(Purpose::Rollout) }
    }

    /// Returns the parameters of a point in the unit box. Parameters that are whole numbers are rounded.
    fn parameters(&self, unit: &[f64]) -> Vec<f64> {
        let scaled = unit.iter().zip(&self.bounds).zip(&self.whole);
        scaled
            .map(|((u, [low, high]), whole)| {
                let value = (low + u * (high - low)).clamp(*low, *high);
                if *whole { value.round().clamp(low.ceil(), high.floor()) } else { value }
            })
            .collect()
    }

    /// Returns the point in the unit box with rounded parameters.
    fn rounded(&self, unit: &[f64]) -> Vec<f64> {
        if !self.whole.contains(&true) {
            return unit.to_vec();
        }
        let parameters = self.parameters(unit);
        parameters.iter().zip(&self.bounds).map(|(x, [low, high])| (x - low) / (high - low)).collect()
    }

    fn is_feasible(&self, unit: &[f64]) -> bool {
        self.feasible.as_ref().is_none_or(|feasible| feasible(&self.parameters(unit)))
    }

    /// Returns the points `first..` of a quasi-random sequence in the unit box, shifted by the random numbers
    /// of a counter.
    fn sequence(&self, counter: Counter, first: u64) -> impl Iterator<Item = Vec<f64>> {
        let n = self.bounds.len();
        let mut random = counter.stream(Purpose::Acquisition);
        let shift: Vec<f64> = (0..n).map(|_| random.random()).collect();
        // the root of x^(n + 1) = x + 1
        let root = (0..64).fold(2.0_f64, |x, _| (1.0 + x).powf(1.0 / (n as f64 + 1.0)));
        (first..).map(move |k| {
            let entry = |(j, shift): (usize, &f64)| {
                (shift + (k + 1) as f64 * root.powi(-(j as i32 + 1))).rem_euclid(1.0)
            };
            shift.iter().enumerate().map(entry).collect()
        })
    }

    fn initial_point(&self) -> Option<Vec<f64>> {
        let counter = Counter { seed: self.seed, world: 1, ..Counter::default() };
        let taken = 1 + self.settings.points;
        // skip the points of all earlier candidates
        let points = self.sequence(counter, 0).skip(self.asked as usize);
        points.take(taken).find(|point| self.is_feasible(point)).map(|point| self.rounded(&point))
    }

    fn standardised(fit: &Fit, reward: f64) -> f64 {
        (reward - fit.mean) / fit.deviation
    }

    /// Adds new rewards to the data, fits hyperparameters when due, and updates the process.
    fn absorb(&mut self) {
        for (unit, reward) in core::mem::take(&mut self.fresh).into_values() {
            // a failed evaluation is as bad as the worst so far
            let worst = self.rewards.iter().copied().fold(f64::INFINITY, f64::min);
            let reward = reward.unwrap_or(if worst.is_finite() { worst } else { 0.0 });
            self.points.extend_from_slice(&unit);
            self.rewards.push(reward);
            if let (Some(process), Some(fit)) = (&mut self.process, &self.fit) {
                // a point that makes the covariance singular is ignored until the next fit
                let _ = process.push(&unit, &[Self::standardised(fit, reward)]);
            }
        }
        let due = self.fit.as_ref().is_none_or(|fit| self.rewards.len() >= fit.count + self.settings.refit);
        if due && !self.rewards.is_empty() && self.refit().is_err() {
            self.process = None;
        }
    }

    fn refit(&mut self) -> Result<(), GpError> {
        let n = self.bounds.len();
        let count = self.rewards.len();
        let mean = self.rewards.iter().sum::<f64>() / count as f64;
        let variance = self.rewards.iter().map(|reward| (reward - mean).powi(2)).sum::<f64>() / count as f64;
        let deviation = if variance > 0.0 { variance.sqrt() } else { 1.0 };
        // length scales of 0.5, variance 1, noise 1e-3
        let prior: Vec<f64> = core::iter::once(0.0)
            .chain(core::iter::repeat_n(0.5_f64.ln(), n))
            .chain([1e-3_f64.ln()])
            .collect();
        let mut fit = Fit { count, parameters: prior.clone(), mean, deviation };
        let process = self.build(&fit)?;
        let noise = NOISE.map(f64::ln);
        let objective = |parameters: &[f64], gradient: &mut [f64]| {
            let mut inside = parameters.to_vec();
            let last = inside.len() - 1;
            inside[last] = inside[last].clamp(noise[0], noise[1]);
            inside[..last].iter_mut().for_each(|value| *value = value.clamp(-6.0, 6.0));
            let Ok(mut value) = process.energy(&inside, gradient) else { return f64::INFINITY };
            for i in 0..last {
                let away = inside[i] - prior[i];
                value += 0.5 * away * away;
                gradient[i] += away;
            }
            for i in 0..=last {
                if inside[i] != parameters[i] {
                    gradient[i] = 0.0;
                }
            }
            value
        };
        let options = Options { iterations: 25, improvement: 1e-5, gradient: 1e-4, ..Options::default() };
        let mut starts = vec![prior.clone()];
        starts.extend(self.fit.as_ref().map(|fit| fit.parameters.clone()));
        let mut least = f64::INFINITY;
        for mut parameters in starts {
            let found = minimise(&mut parameters, &options, objective);
            if found.value < least {
                let last = parameters.len() - 1;
                parameters[last] = parameters[last].clamp(noise[0], noise[1]);
                parameters[..last].iter_mut().for_each(|value| *value = value.clamp(-6.0, 6.0));
                (least, fit.parameters) = (found.value, parameters);
            }
        }
        self.process = Some(self.build(&fit)?);
        self.fit = Some(fit);
        Ok(())
    }

    /// Builds the process of a fit from the rewards at the time of the fit.
    fn build(&self, fit: &Fit) -> Result<GaussianProcess, GpError> {
        let n = self.bounds.len();
        let mut kernel = self.settings.smoothness.kernel(n);
        kernel.set_parameters(&fit.parameters);
        let noise = fit.parameters[n + 1].exp();
        let rewards: Vec<f64> =
            self.rewards[..fit.count].iter().map(|r| Self::standardised(fit, *r)).collect();
        GaussianProcess::new(kernel, noise, &self.points[..fit.count * n], n, &rewards, 1)
    }

    /// Returns the acquisition at a point of the unit box.
    fn value(&self, process: &GaussianProcess, best: f64, unit: &[f64], scratch: &mut Scratch) -> f64 {
        let mut mean = [0.0];
        let variance = process.predict(&self.rounded(unit), &mut mean, scratch) - process.noise();
        self.settings.acquisition.value(mean[0], variance.max(0.0).sqrt(), best)
    }

    /// Returns the point with the largest acquisition. `best` is the best standardised reward, including
    /// assumed rewards.
    fn propose(&self, process: &GaussianProcess, best: f64) -> Option<Vec<f64>> {
        let n = self.bounds.len();
        let mut scratch = process.scratch();
        let incumbent =
            (0..self.rewards.len()).max_by(|a, b| self.rewards[*a].total_cmp(&self.rewards[*b]))?;
        let counter = Counter { seed: self.seed, step: self.asked, ..Counter::default() };
        let mut random = counter.stream(Purpose::Candidate);
        let local = self.settings.points / 10;
        let around: Vec<Vec<f64>> = (0..local)
            .map(|_| {
                let center = &self.points[incumbent * n..][..n];
                let near = |x: &f64| {
                    let noise: f64 = StandardNormal.sample(&mut random);
                    (x + 0.05 * noise).clamp(0.0, 1.0)
                };
                center.iter().map(near).collect()
            })
            .collect();
        let mut found: Vec<(f64, Vec<f64>)> = self
            .sequence(counter, 0)
            .take(self.settings.points)
            .chain(around)
            .filter(|point| self.is_feasible(point))
            .map(|point| (self.value(process, best, &point, &mut scratch), point))
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.truncate(self.settings.starts);
        let options = Options { iterations: 15, improvement: 1e-4, gradient: 1e-5, step: 0.2, memory: 5 };
        let mut chosen: Option<(f64, Vec<f64>)> = None;
        for (value, start) in found {
            let mut point = start.clone();
            minimise(&mut point, &options, |point, gradient| {
                let inside: Vec<f64> = point.iter().map(|x| x.clamp(0.0, 1.0)).collect();
                let mut probe = inside.clone();
                let value = self.value(process, best, &inside, &mut scratch);
                for i in 0..n {
                    let step = if inside[i] > 0.5 { -1e-6 } else { 1e-6 };
                    probe[i] = inside[i] + step;
                    let there = self.value(process, best, &probe, &mut scratch);
                    probe[i] = inside[i];
                    gradient[i] = if inside[i] == point[i] { (value - there) / step } else { 0.0 };
                }
                -value
            });
            point.iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
            let improved = self.value(process, best, &point, &mut scratch);
            let (value, point) =
                if improved > value && self.is_feasible(&point) { (improved, point) } else { (value, start) };
            if chosen.as_ref().is_none_or(|(most, _)| value > *most) {
                chosen = Some((value, point));
            }
        }
        chosen.map(|(_, point)| self.rounded(&point))
    }
}

impl Search for BayesianOptimisation {
    fn dimensions(&self) -> usize {
        self.bounds.len()
    }

    fn ask(&mut self, count: usize) -> Vec<Candidate> {
        // limit the request: there is always one more point
        let count = count.min(1024);
        self.absorb();
        let mut model = self.process.clone();
        let best = self.rewards.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut best = self.fit.as_ref().map_or(best, |fit| Self::standardised(fit, best));
        if let Some(process) = &mut model {
            for unit in self.pending.values() {
                best = best.max(believe(process, unit));
            }
        }
        let mut asked = Vec::new();
        for _ in 0..count {
            let is_initial = self.asked < self.settings.initial as u64;
            let point = match (&mut model, &self.fit) {
                (Some(process), Some(_)) if !is_initial => {
                    let point = self.propose(process, best);
                    point.inspect(|point| best = best.max(believe(process, point)))
                }
                _ => self.initial_point(),
            };
            let Some(unit) = point else { break };
            let candidate = self.candidate(self.asked, &unit);
            self.pending.insert(self.asked, unit);
            self.asked += 1;
            asked.push(candidate);
        }
        asked
    }

    fn tell(&mut self, rewards: &[(u64, f64)]) -> Result<(), TellError> {
        let mut seen = Vec::with_capacity(rewards.len());
        for (id, _) in rewards {
            if seen.contains(id) || self.fresh.contains_key(id) {
                return Err(TellError::Repeated { id: *id });
            }
            if !self.pending.contains_key(id) {
                let first = self.pending.keys().next().copied().unwrap_or(self.asked);
                return Err(TellError::Unknown { id: *id, first, last: self.asked.saturating_sub(1) });
            }
            seen.push(*id);
        }
        for (id, reward) in rewards {
            let Some(unit) = self.pending.remove(id) else { continue };
            self.best.record(*id, &self.parameters(&unit), *reward);
            self.fresh.insert(*id, (unit, Some(*reward).filter(|reward| reward.is_finite())));
        }
        Ok(())
    }

    fn pending(&self) -> Vec<Candidate> {
        self.pending.iter().map(|(id, unit)| self.candidate(*id, unit)).collect()
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }

    fn save(&self) -> String {
        Saved::write(METHOD, self)
    }

    fn restore(&mut self, state: &str) -> Result<(), RestoreError> {
        let dimensions = self.dimensions();
        let mut search = Saved::<Self>::read(METHOD, dimensions, state)?;
        if let Some(fit) = &search.fit {
            // the same operations in the same order as in the saved search, for bit-for-bit equality
            let process = search.build(fit).map(|mut process| {
                for k in fit.count..search.rewards.len() {
                    let unit = &search.points[k * dimensions..][..dimensions];
                    let _ = process.push(unit, &[Self::standardised(fit, search.rewards[k])]);
                }
                process
            });
            search.process = process.ok();
        }
        search.feasible = self.feasible.take();
        *self = search;
        Ok(())
    }
}

/// Adds the predicted mean at a point as its assumed reward, and returns the mean.
fn believe(process: &mut GaussianProcess, unit: &[f64]) -> f64 {
    let mut mean = [0.0];
    let mut scratch = process.scratch();
    process.predict(unit, &mut mean, &mut scratch);
    // a repeated point adds nothing
    let _ = process.push(unit, &mean);
    mean[0]
}

#[cfg(test)]
mod tests {
    use super::super::tests::rollouts;
    use super::*;

    fn branin(p: &[f64]) -> f64 {
        use std::f64::consts::PI;
        let (x, y) = (p[0], p[1]);
        let bowl = y - 5.1 / (4.0 * PI * PI) * x * x + 5.0 / PI * x - 6.0;
        -(bowl * bowl + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x.cos() + 10.0)
    }

    fn search(seed: u64, settings: BayesianSettings) -> BayesianOptimisation {
        BayesianOptimisation::new(vec![[-5.0, 10.0], [0.0, 15.0]], settings, seed).expect("a search")
    }

    #[test]
    fn branin_is_solved_in_40_evaluations() {
        for acquisition in [
            Acquisition::default(),
            Acquisition::UpperConfidence(2.576),
            Acquisition::ProbabilityOfImprovement(0.05),
        ] {
            let settings = BayesianSettings { acquisition, points: 500, ..BayesianSettings::default() };
            let mut search = search(1, settings);
            rollouts(&mut search, 40, branin);
            // the optimum is -0.397887
            let reward = search.best().expect("rewards").1;
            assert!(reward > -0.5, "{acquisition:?}: {reward}");
        }
    }

    #[test]
    fn radial_kernel_solves_branin() {
        let settings =
            BayesianSettings { smoothness: Smoothness::Rbf, points: 500, ..BayesianSettings::default() };
        let mut search = search(1, settings);
        rollouts(&mut search, 40, branin);
        assert!(search.best().expect("rewards").1 > -0.5, "{:?}", search.best());
        let kernel = search.process.as_ref().map(|process| process.kernel().clone());
        assert!(matches!(kernel, Some(Kernel::Rbf(_))), "{kernel:?}");
    }

    #[test]
    fn whole_numbers_and_constraints_hold() {
        let settings = BayesianSettings { points: 300, ..BayesianSettings::default() };
        let mut search = BayesianOptimisation::new(vec![[0.5, 9.5], [-1.0, 1.0]], settings, 3)
            .and_then(|search| search.with_whole_numbers(vec![true, false]))
            .expect("a search")
            .with_constraint(|x| x[0] + x[1] <= 6.5);
        let mut seen = vec![];
        for _ in 0..25 {
            for candidate in search.ask(1) {
                let x = &candidate.parameters;
                assert!(x[0].fract() == 0.0 && (1.0..=9.0).contains(&x[0]) && x[0] + x[1] <= 6.5, "{x:?}");
                seen.push(x[0]);
                search.tell(&[(candidate.id, -(x[0] - 8.0).powi(2) - (x[1] - 0.5).powi(2))]).expect("known");
            }
        }
        // the constraint is active at the optimum: 7 and -0.5
        let (best, reward) = search.best().expect("rewards");
        assert!(best[0] == 7.0 && reward > -2.01, "{best:?}: {reward}, tried {seen:?}");
    }

    #[test]
    fn points_evaluated_together_differ() {
        let settings = BayesianSettings { points: 300, ..BayesianSettings::default() };
        let mut search = search(2, settings);
        rollouts(&mut search, 15, branin);
        let together = search.ask(4);
        assert_eq!(together.len(), 4);
        for (index, one) in together.iter().enumerate() {
            for other in &together[..index] {
                let apart = one.parameters.iter().zip(&other.parameters).map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, f64::max) > 1e-3, "{:?} twice", one.parameters);
            }
        }
        // rewards may be reported in any order
        let rewards = together.iter().rev().map(|candidate| (candidate.id, branin(&candidate.parameters)));
        search.tell(&rewards.collect::<Vec<_>>()).expect("known candidates");
        assert!(search.pending().is_empty());
        assert_eq!((search.ask(1).len(), search.rewards.len()), (1, 19));
    }

    #[test]
    fn failed_evaluations_count_as_the_worst() {
        let mut search = search(4, BayesianSettings { points: 300, ..BayesianSettings::default() });
        rollouts(&mut search, 20, |x| if x[0] < 0.0 { f64::NAN } else { branin(x) });
        let (best, reward) = search.best().expect("rewards");
        assert!(best[0] >= 0.0 && reward > -2.0, "{best:?}: {reward}");
        assert!(search.rewards.iter().all(|reward| reward.is_finite()));
    }
}
