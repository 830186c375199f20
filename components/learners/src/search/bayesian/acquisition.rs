//! Acquisition functions.

use std::f64::consts::{PI, SQRT_2, TAU};

use serde::{Deserialize, Serialize};

/// Function whose maximum is the next point to evaluate. Rewards are standardised, so margins are in standard
/// deviations of the rewards.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Acquisition {
    /// Expected improvement over the sum of the best reward and this margin, at least 0. This function is the
    /// default, with a margin of 0.01.
    ExpectedImprovement(f64),
    /// Mean plus this number of standard deviations, at least 0. A common value is 2.576.
    UpperConfidence(f64),
    /// Probability of exceeding the sum of the best reward and this margin, at least 0. A common margin is
    /// 0.01.
    ProbabilityOfImprovement(f64),
}

impl Default for Acquisition {
    fn default() -> Self {
        Self::ExpectedImprovement(0.01)
    }
}

impl Acquisition {
    /// Returns the parameter of the function.
    pub(super) fn parameter(self) -> f64 {
        let (Self::ExpectedImprovement(value)
        | Self::UpperConfidence(value)
        | Self::ProbabilityOfImprovement(value)) = self;
        value
    }

    /// Returns a monotone function of the acquisition at a point with this mean and standard deviation.
    /// Improvement and probability are logarithms, which do not underflow far below the best reward.
    pub(super) fn value(self, mean: f64, deviation: f64, best: f64) -> f64 {
        let deviation = deviation.max(1e-12);
        match self {
            Self::UpperConfidence(kappa) => mean + kappa * deviation,
            Self::ExpectedImprovement(margin) => {
                let z = (mean - best - margin) / deviation;
                ln_improvement(z) + deviation.ln()
            }
            Self::ProbabilityOfImprovement(margin) => ln_probability((mean - best - margin) / deviation),
        }
    }
}

/// Returns `ln(phi(z) + z Phi(z))` for the standard normal distribution.
fn ln_improvement(z: f64) -> f64 {
    let ln_density = -0.5 * z * z - 0.5 * TAU.ln();
    if z > -25.0 {
        // phi + z Phi = phi (1 + z Phi / phi); the bracket is about 1 / z^2 far below 0
        let ratio = 0.5 * scaled_complement(-z / SQRT_2) * TAU.sqrt();
        ln_density + (1.0 + z * ratio).max(f64::MIN_POSITIVE).ln()
    } else {
        ln_density - 2.0 * (-z).ln()
    }
}

/// Returns `ln Phi(z)` for the standard normal distribution.
fn ln_probability(z: f64) -> f64 {
    if z > 0.0 {
        return (-0.5 * (-0.5 * z * z).exp() * scaled_complement(z / SQRT_2)).ln_1p();
    }
    -0.5 * z * z + (0.5 * scaled_complement(-z / SQRT_2)).ln()
}

/// Returns `exp(x^2) erfc(x)`, by a series below 2 and a continued fraction above.
fn scaled_complement(x: f64) -> f64 {
    if x < 2.0 {
        // erf(x) = 2 x / sqrt(pi) exp(-x^2) sum_n (2 x^2)^n / (2 n + 1)!!
        let (mut term, mut sum, mut n) = (1.0, 1.0, 0.0);
        while term > 1e-17 * sum {
            n += 1.0;
            term *= 2.0 * x * x / (2.0 * n + 1.0);
            sum += term;
        }
        return (x * x).exp() - 2.0 * x / PI.sqrt() * sum;
    }
    // erfc(x) exp(x^2) sqrt(pi) = 1 / (x + 1/2 / (x + 1 / (x + 3/2 / (x + ...))))
    let fraction = (1..=60).rev().fold(x, |below, k| x + 0.5 * f64::from(k) / below);
    1.0 / (PI.sqrt() * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_tails_match_known_values() {
        // scipy.stats.norm.logcdf
        for (z, expected) in [
            (0.0, -std::f64::consts::LN_2),
            (1.0, -0.172_753_779_023_449_86),
            (-1.0, -1.841_021_645_009_263_5),
            (-5.0, -15.064_998_393_988_727),
            (-30.0, -454.321_243_956_340_34),
            (3.0, -0.001_350_809_964_748_202_5),
        ] {
            let found = ln_probability(z);
            assert!((found / expected - 1.0).abs() < 1e-12, "{z}: {found} {expected}");
        }
    }

    #[test]
    fn expected_improvement_matches_its_integral() {
        for z in [-6.0, -3.0, -1.0, 0.0, 0.7, 2.5] {
            // integral of (x + z) phi(x) over x > -z by the midpoint rule
            let step: f64 = 1e-4;
            let density = |x: f64| (-0.5 * x * x).exp() / TAU.sqrt();
            let area: f64 = (0..150_000)
                .map(|k| -z + (f64::from(k) + 0.5) * step)
                .map(|x| (x + z) * density(x) * step)
                .sum();
            let found = ln_improvement(z).exp();
            assert!((found / area - 1.0).abs() < 1e-6, "{z}: {found:e} {area:e}");
        }
        let (near, far) = (ln_improvement(-24.999), ln_improvement(-25.001));
        assert!((near - far - 0.05).abs() < 0.01, "{near} {far}");
    }

    #[test]
    fn acquisitions_grow_with_the_mean() {
        for kind in [
            Acquisition::default(),
            Acquisition::UpperConfidence(2.576),
            Acquisition::ProbabilityOfImprovement(0.01),
        ] {
            assert!(kind.value(0.5, 0.3, 1.0) > kind.value(0.2, 0.3, 1.0), "{kind:?}");
            // below the best reward, uncertainty is promising
            assert!(kind.value(0.5, 0.3, 1.0) > kind.value(0.5, 0.1, 1.0), "{kind:?}");
            assert!(kind.value(-1e3, 1e-3, 1.0).is_finite(), "{kind:?}");
        }
    }
}
