//! PoWER: policy learning by weighting exploration with the returns.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

/// Settings of [`Power`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerSettings {
    /// Number of rollouts in an update: the best so far. Default 10.
    pub best: usize,
    /// The least and the largest factor on the first variance of exploration. Default 0.1 and 10.
    pub variance: [f64; 2],
}

impl Default for PowerSettings {
    fn default() -> Self {
        Self { best: 10, variance: [0.1, 10.0] }
    }
}

/// A search for the parameters `theta` of the largest reward, one rollout at a time.
///
/// Each rollout explores with `theta + eps`, `eps ~ N(0, Sigma)`, `Sigma` diagonal. Of all rollouts seen, the
/// best are kept (importance sampling), and with their rewards `R_j > 0`, `eps_j = theta_j - theta`:
///
/// ```text
/// theta' = theta + (sum_j R_j Sigma_j^-1)^-1 sum_j R_j Sigma_j^-1 eps_j
/// Sigma' = diag(sum_j R_j eps_j^2 / sum_j R_j), within bounds
/// ```
///
/// For weights of a motion library, `k^2 s_i^2 / N` (the variance of the weights in the library, `k` about
/// 0.6) is the natural first exploration: large where movements differ.
///
/// Source: Kober, Peters, *Policy search for motor primitives in robotics*, Machine Learning 84, 2011, the
/// episodic form; the update of the variance after their appendix.
///
/// ```
/// use motorium_learners::{Power, PowerSettings};
///
/// // Finds the parameters (1, -2) from their reward alone.
/// let mut search = Power::new(vec![0.0; 2], vec![1.0; 2], PowerSettings::default(), 7);
/// for _ in 0..300 {
///     let theta = search.propose();
///     let reward = (-(theta[0] - 1.0).powi(2) - (theta[1] + 2.0).powi(2)).exp();
///     search.report(reward);
/// }
/// let (best, reward) = search.best().unwrap();
/// assert!(reward > 0.9, "{best:?}");
/// ```
#[derive(Clone, Debug)]
pub struct Power {
    settings: PowerSettings,
    theta: Vec<f64>,
    first: Vec<f64>,
    variance: Vec<f64>,
    memory: Vec<Rollout>,
    candidate: Vec<f64>,
    random: Pcg64,
}

#[derive(Clone, Debug)]
struct Rollout {
    reward: f64,
    theta: Vec<f64>,
    variance: Vec<f64>,
}

impl Power {
    /// A search that starts at `theta`, with a variance of exploration for each parameter.
    ///
    /// # Panics
    /// When there are not as many variances as parameters.
    pub fn new(theta: Vec<f64>, variance: Vec<f64>, settings: PowerSettings, seed: u64) -> Self {
        assert_eq!(theta.len(), variance.len(), "one variance for each parameter");
        let random = Pcg64::seed_from_u64(seed);
        let (candidate, first) = (theta.clone(), variance.clone());
        Self { settings, theta, first, variance, memory: Vec::new(), candidate, random }
    }

    /// The parameters to try next; at first the initial ones.
    pub fn propose(&mut self) -> &[f64] {
        self.candidate.copy_from_slice(&self.theta);
        if !self.memory.is_empty() {
            for (entry, variance) in self.candidate.iter_mut().zip(&self.variance) {
                let noise: f64 = StandardNormal.sample(&mut self.random);
                *entry += variance.sqrt() * noise;
            }
        }
        &self.candidate
    }

    /// Records the reward of the last proposal; one that is not a positive number counts as zero.
    pub fn report(&mut self, reward: f64) {
        let reward = if reward.is_finite() { reward.max(0.0) } else { 0.0 };
        let (theta, variance) = (self.candidate.clone(), self.variance.clone());
        self.memory.push(Rollout { reward, theta, variance });
        self.memory.sort_by(|a, b| b.reward.total_cmp(&a.reward));
        self.memory.truncate(self.settings.best.max(1));
        let total: f64 = self.memory.iter().map(|rollout| rollout.reward).sum();
        if total <= 0.0 {
            return;
        }
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
            let [low, high] = self.settings.variance.map(|factor| factor * self.first[i]);
            self.variance[i] = (spread / total).clamp(low, high);
        }
    }

    /// The best parameters seen, and their reward.
    pub fn best(&self) -> Option<(&[f64], f64)> {
        self.memory.first().map(|rollout| (rollout.theta.as_slice(), rollout.reward))
    }

    /// The centre of the exploration.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_valley_is_descended_and_the_same_seed_goes_the_same_way() {
        let goal = [1.0, -2.0, 0.5];
        let reward = |theta: &[f64]| {
            (-0.5 * theta.iter().zip(&goal).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()).exp()
        };
        let search = |seed| {
            let mut power = Power::new(vec![0.0; 3], vec![0.5; 3], PowerSettings::default(), seed);
            for _ in 0..300 {
                let reward = reward(power.propose());
                power.report(reward);
            }
            power
        };
        for seed in 0..5 {
            let found = search(seed);
            let (theta, best) = found.best().unwrap();
            assert!(best > 0.97, "{theta:?}: {best}");
            assert_eq!(theta, search(seed).best().unwrap().0);
        }
    }

    #[test]
    fn rewards_that_are_no_numbers_change_nothing() {
        let mut power = Power::new(vec![1.0], vec![1.0], PowerSettings::default(), 0);
        for _ in 0..20 {
            power.propose();
            power.report(f64::NAN);
        }
        assert_eq!(power.theta(), [1.0]);
    }
}
