//! PoWER: policy learning by weighting exploration with the returns.

use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`Power`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PowerSettings {
    /// Number of rollouts between two updates, at least 1. Default 1.
    pub population: usize,
    /// Number of the best rollouts so far from which an update is computed, at least 1. Default 10.
    pub best: usize,
    /// Minimum and maximum factor on the initial variance of the exploration. Default 0.1 and 10.
    pub variance: [f64; 2],
}

impl Default for PowerSettings {
    fn default() -> Self {
        Self { population: 1, best: 10, variance: [0.1, 10.0] }
    }
}

/// A search for the parameters `theta` with the largest reward, which evaluates one rollout at a time
/// (PoWER).
///
/// Each rollout explores with `theta + eps`, `eps ~ N(0, Sigma)`, `Sigma` diagonal; the first rollout is the
/// start. The best rollouts so far are kept (importance sampling). With their rewards `R_j > 0` and `eps_j =
/// theta_j - theta`:
///
/// ```text
/// theta' = theta + (sum_j R_j Sigma_j^-1)^-1 sum_j R_j Sigma_j^-1 eps_j
/// Sigma' = diag(sum_j R_j eps_j^2 / sum_j R_j), within bounds
/// ```
///
/// Rewards must be positive; other rewards count as 0. For weights of a motion library, `k^2 s_i^2 / N` (the
/// variance of the weights in the library, `k` about 0.6) is the natural initial exploration, because this
/// variance is large where movements differ.
///
/// Source: Kober, Peters, *Policy search for motor primitives in robotics*, Machine Learning 84, 2011, the
/// episodic form; the update of the variance follows their appendix.
pub type Power = Generations<Weighted>;

/// Search distribution of [`Power`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Weighted {
    settings: PowerSettings,
    theta: Vec<f64>,
    variance: Vec<f64>,
    memory: Vec<Rollout>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Rollout {
    reward: f64,
    theta: Vec<f64>,
    variance: Vec<f64>,
}

impl Power {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: PowerSettings) -> Result<Self, StartError> {
        let PowerSettings { population, best, variance: [low, high] } = settings;
        StartError::check("population", population as f64, population > 0, "at least 1")?;
        StartError::check("best", best as f64, best > 0, "at least 1")?;
        StartError::check("variance", low, 0.0 < low && low <= high, "a range of positive factors")?;
        Self::build(start, |start| {
            let n = start.dimensions();
            Ok(Weighted { settings, theta: vec![0.0; n], variance: vec![1.0; n], memory: vec![] })
        })
    }
}

impl Distribution for Weighted {
    const METHOD: &'static str = "power";

    fn dimensions(&self) -> usize {
        self.theta.len()
    }

    fn population(&self) -> usize {
        self.settings.population
    }

    fn sample(&mut self, index: usize, random: &mut Pcg64, point: &mut [f64]) {
        let explore = if index == 0 && self.memory.is_empty() { 0.0 } else { 1.0 };
        for (x, (theta, variance)) in point.iter_mut().zip(self.theta.iter().zip(&self.variance)) {
            let noise: f64 = StandardNormal.sample(random);
            *x = theta + explore * variance.sqrt() * noise;
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        for (index, reward) in samples.rewards.iter().enumerate() {
            let (theta, variance) = (samples.point(index).to_vec(), self.variance.clone());
            self.memory.push(Rollout { reward: reward.max(0.0), theta, variance });
        }
        self.memory.sort_by(|a, b| b.reward.total_cmp(&a.reward));
        self.memory.truncate(self.settings.best);
        let total: f64 = self.memory.iter().map(|rollout| rollout.reward).sum();
        if total <= 0.0 {
            return;
        }
        let [low, high] = self.settings.variance;
        for i in 0..self.theta.len() {
            let (mut weight, mut step, mut spread) = (0.0, 0.0, 0.0);
            for rollout in &self.memory {
                let away = rollout.theta[i] - self.theta[i];
                let certainty = rollout.reward / rollout.variance[i].max(f64::MIN_POSITIVE);
                weight += certainty;
                step += certainty * away;
                spread += rollout.reward * away * away;
            }
            self.theta[i] += step / weight;
            self.variance[i] = (spread / total).clamp(low, high);
        }
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.theta);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Search as _, tests::rollouts};
    use super::*;

    #[test]
    fn quadratic_valley_is_descended_reproducibly() {
        let goal = [1.0, -2.0, 0.5];
        let reward = |theta: &[f64]| {
            (-0.5 * theta.iter().zip(&goal).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()).exp()
        };
        let search = |seed| {
            let start = Start::new(vec![0.0; 3], vec![0.5_f64.sqrt(); 3], seed);
            let mut power = Power::new(start, PowerSettings::default()).expect("a search");
            rollouts(&mut power, 300, reward);
            power
        };
        for seed in 0..5 {
            let found = search(seed);
            let (theta, best) = found.best().expect("rewards");
            assert!(best > 0.97, "{theta:?}: {best}");
            assert_eq!(theta, search(seed).best().expect("rewards").0);
        }
    }

    #[test]
    fn rewards_that_are_not_numbers_change_nothing() {
        let start = Start::new(vec![1.0], vec![1.0], 0);
        let mut power = Power::new(start, PowerSettings::default()).expect("a search");
        rollouts(&mut power, 20, |_| f64::NAN);
        assert_eq!(power.mean(), [1.0]);
        assert_eq!(power.best(), None);
    }
}
