//! Distributions of actions that a policy puts out.

use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, StandardNormal};

use super::rollout::Spread;
use crate::learner::log_sum;

/// The distribution of actions around the outputs of a policy.
#[derive(Clone, Debug)]
pub(super) enum Distribution {
    /// Continuous actions, normally distributed around the outputs.
    Normal(Spread),
    /// Choices, whose probabilities are the softmax of the outputs. The stored action is the number of the
    /// choice.
    Categorical,
}

/// Numbers that the gradient of a sample is added to or written into.
#[derive(Debug)]
pub(super) struct Slopes<'a> {
    /// Gradient by the outputs of the policy.
    pub(super) by_output: &'a mut [f32],
    /// Sum of the gradients by the logarithms of the deviations.
    pub(super) by_deviation: &'a mut [f32],
}

impl Distribution {
    /// Samples an action; returns the logarithm of its probability or of its density.
    pub(super) fn sample(&self, output: &[f32], random: &mut impl Rng, action: &mut [f32]) -> f32 {
        match self {
            Self::Normal(spread) => {
                for ((action, mean), deviation) in action.iter_mut().zip(output).zip(&spread.deviations) {
                    let noise: f32 = StandardNormal.sample(random);
                    *action = mean + deviation * noise;
                }
                spread.log_density(action, output)
            }
            Self::Categorical => {
                let total = log_sum(output);
                let share: f32 = random.random();
                let (mut sum, mut choice) = (0.0, output.len() - 1);
                for (k, logit) in output.iter().enumerate() {
                    sum += (logit - total).exp();
                    if share < sum {
                        choice = k;
                        break;
                    }
                }
                action[0] = choice as f32;
                output[choice] - total
            }
        }
    }

    /// Logarithm of the probability or of the density of an action.
    pub(super) fn log_density(&self, action: &[f32], output: &[f32]) -> f32 {
        match self {
            Self::Normal(spread) => spread.log_density(action, output),
            Self::Categorical => output[action[0] as usize] - log_sum(output),
        }
    }

    /// Writes the gradient of the logarithm of the density, times a factor.
    pub(super) fn slopes(&self, (action, output): (&[f32], &[f32]), factor: f32, slopes: Slopes<'_>) {
        let Slopes { by_output, by_deviation } = slopes;
        match self {
            Self::Normal(spread) => spread.slopes((action, output), factor, by_output, by_deviation),
            Self::Categorical => {
                let total = log_sum(output);
                for ((slope, logit), k) in by_output.iter_mut().zip(output).zip(0..) {
                    let is_chosen = f32::from(k == action[0] as usize);
                    *slope = factor * (is_chosen - (logit - total).exp());
                }
            }
        }
    }

    /// Adds the gradient of the entropy, times a factor, and returns the entropy. Both are 0 for a normal
    /// distribution, whose entropy does not depend on its mean.
    pub(super) fn add_entropy(&self, output: &[f32], factor: f32, by_output: &mut [f32]) -> f32 {
        match self {
            Self::Normal(_) => 0.0,
            Self::Categorical => {
                let total = log_sum(output);
                let logarithm = |logit: &f32| logit - total;
                let entropy = -output.iter().map(logarithm).map(|l| l.exp() * l).sum::<f32>();
                for (slope, logit) in by_output.iter_mut().zip(output) {
                    let l = logarithm(logit);
                    *slope -= factor * l.exp() * (l + entropy);
                }
                entropy
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Counter, Purpose};

    const LOGITS: [f32; 4] = [0.3, -1.2, 2.0, 0.9];

    fn probabilities() -> [f64; 4] {
        let exponentials = LOGITS.map(|logit| f64::from(logit).exp());
        let sum: f64 = exponentials.iter().sum();
        exponentials.map(|exponential| exponential / sum)
    }

    #[test]
    fn choices_are_as_frequent_as_their_softmax() {
        let mut random = Counter::default().stream(Purpose::Action);
        let mut counts = [0.0; 4];
        for _ in 0..40_000 {
            let mut action = [0.0];
            let logarithm = Distribution::Categorical.sample(&LOGITS, &mut random, &mut action);
            assert_eq!(logarithm, Distribution::Categorical.log_density(&action, &LOGITS));
            counts[action[0] as usize] += 1.0 / 40_000.0;
        }
        for (k, (count, expected)) in counts.into_iter().zip(probabilities()).enumerate() {
            assert!((count - expected).abs() < 0.01, "{k}: {count} {expected}");
            let logarithm = f64::from(Distribution::Categorical.log_density(&[k as f32], &LOGITS));
            assert!((logarithm - expected.ln()).abs() < 1e-6, "{k}: {logarithm}");
        }
    }

    #[test]
    fn slopes_of_choices_match_finite_differences() {
        let distribution = Distribution::Categorical;
        // entropy in double precision, independent of the code
        let entropy = |logits: &[f32]| {
            let sum: f64 = logits.iter().map(|logit| f64::from(*logit).exp()).sum();
            let p = |logit: &f32| f64::from(*logit).exp() / sum;
            -logits.iter().map(|logit| p(logit) * p(logit).ln()).sum::<f64>()
        };
        let (mut by_log, mut by_entropy) = ([0.0; 4], [0.0; 4]);
        let slopes = Slopes { by_output: &mut by_log, by_deviation: &mut [] };
        distribution.slopes((&[2.0], &LOGITS), 3.0, slopes);
        let found = distribution.add_entropy(&LOGITS, 1.0, &mut by_entropy);
        assert!((f64::from(found) - entropy(&LOGITS)).abs() < 1e-6, "{found}");
        for k in 0..4 {
            let moved = |step: f32| {
                let mut logits = LOGITS;
                logits[k] += step;
                logits
            };
            let [up, down] = [moved(1e-2), moved(-1e-2)];
            let slope = |f: &dyn Fn(&[f32]) -> f64| (f(&up) - f(&down)) / 2e-2;
            let log = slope(&|logits| 3.0 * f64::from(distribution.log_density(&[2.0], logits)));
            assert!((log - f64::from(by_log[k])).abs() < 1e-3, "{k}: {log} {}", by_log[k]);
            let change = slope(&|logits| entropy(logits));
            assert!((change - f64::from(by_entropy[k])).abs() < 1e-4, "{k}: {change} {}", by_entropy[k]);
        }
    }

    #[test]
    fn large_outputs_of_choices_stay_finite() {
        let logits = [1000.0, -1000.0];
        assert_eq!(Distribution::Categorical.log_density(&[0.0], &logits), 0.0);
        assert_eq!(Distribution::Categorical.log_density(&[1.0], &logits), -2000.0);
        assert!(Distribution::Categorical.log_density(&[0.0], &[f32::NAN, 0.0]).is_nan());
        assert!(Distribution::Categorical.log_density(&[0.0], &[f32::INFINITY, 0.0]).is_nan());
    }
}
