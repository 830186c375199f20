//! Episodic relative entropy policy search.

use motorium_algebra::symmetric_eigen;
use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`Reps`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepsSettings {
    /// Number of candidates per generation, at least 2. Default `10 + 4 n` for `n` parameters, because the
    /// covariance has `n (n + 1) / 2` entries.
    pub population: Option<usize>,
    /// Limit of the relative entropy of the reweighted candidates, more than 0, less than `ln population`.
    /// Default 0.5.
    pub epsilon: f64,
    /// Fraction of the previous covariance that an update keeps, at least 0, less than 1. Default 0.5,
    /// because a covariance estimated from few candidates is uncertain.
    pub kept: f64,
}

impl Default for RepsSettings {
    fn default() -> Self {
        Self { population: None, epsilon: 0.5, kept: 0.5 }
    }
}

/// A search that maximises the expected reward with a limited loss of information (REPS).
///
/// Each update reweights the candidates by `w_i ~ exp((R_i - max R) / eta)`, where `eta` minimises the dual
///
/// ```text
/// g(eta) = eta epsilon + eta ln(1/N sum_i exp(R_i / eta))
/// ```
///
/// so that `KL(w || uniform) = epsilon`, and fits a normal distribution by weighted maximum likelihood:
///
/// ```text
/// mean'  = sum_i w_i x_i
/// Sigma' = kept Sigma + (1 - kept) sum_i w_i (x_i - mean')(x_i - mean')^T / (1 - sum_i w_i^2)
/// ```
///
/// Sources: Peters, Muelling, Altun, *Relative entropy policy search*, AAAI 2010; the episodic form after
/// Deisenroth, Neumann, Peters, *A survey on policy search for robotics*, Foundations and Trends in Robotics
/// 2, 2013, section 2.4.3.
pub type Reps = Generations<RelativeEntropy>;

/// Search distribution of [`Reps`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RelativeEntropy {
    settings: RepsSettings,
    population: usize,
    mean: Vec<f64>,
    covariance: Vec<f64>,
    /// A square root of the covariance, column by column.
    root: Vec<f64>,
}

impl Reps {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: RepsSettings) -> Result<Self, StartError> {
        let population = settings.population.unwrap_or(10 + 4 * start.dimensions());
        StartError::check("population", population as f64, population >= 2, "at least 2")?;
        let (epsilon, most) = (settings.epsilon, (population as f64).ln());
        StartError::check(
            "epsilon",
            epsilon,
            0.0 < epsilon && epsilon < most,
            "above 0, below ln population",
        )?;
        StartError::check("kept", settings.kept, (0.0..1.0).contains(&settings.kept), "0 to below 1")?;
        Self::build(start, |start| {
            let n = start.dimensions();
            let identity = DMatrix::<f64>::identity(n, n).as_slice().to_vec();
            let (mean, covariance) = (vec![0.0; n], identity.clone());
            Ok(RelativeEntropy { settings, population, mean, covariance, root: identity })
        })
    }
}

/// Returns weights for rewards with relative entropy `epsilon` to the uniform distribution. They sum to 1.
pub(super) fn entropic_weights(rewards: &[f64], epsilon: f64) -> Vec<f64> {
    let count = rewards.len() as f64;
    let most = rewards.iter().fold(f64::MIN, |most, reward| most.max(*reward));
    let finite = || rewards.iter().copied().filter(|reward| *reward > f64::MIN);
    let least = finite().fold(most, f64::min);
    let weights = |eta: f64| -> Vec<f64> {
        let raw: Vec<f64> = rewards.iter().map(|reward| ((reward - most) / eta).exp()).collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|w| w / sum).collect()
    };
    if most <= least {
        // all finite rewards are equal
        return weights(f64::MIN_POSITIVE);
    }
    let divergence =
        |weights: &[f64]| -> f64 { weights.iter().filter(|w| **w > 0.0).map(|w| w * (w * count).ln()).sum() };
    // the divergence decreases with the temperature: bisect the logarithm of the temperature
    let spread = most - least;
    let (mut low, mut high) = ((1e-8 * spread).ln(), (1e8 * spread).ln());
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if divergence(&weights(middle.exp())) > epsilon {
            low = middle;
        } else {
            high = middle;
        }
    }
    weights(high.exp())
}

impl Distribution for RelativeEntropy {
    const METHOD: &'static str = "reps";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.population
    }

    fn sample(&mut self, _: usize, random: &mut Pcg64, point: &mut [f64]) {
        point.copy_from_slice(&self.mean);
        for column in self.root.chunks_exact(self.mean.len()) {
            let noise: f64 = StandardNormal.sample(random);
            point.iter_mut().zip(column).for_each(|(x, entry)| *x += noise * entry);
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        let n = self.mean.len();
        let weights = entropic_weights(samples.rewards, self.settings.epsilon);
        self.mean.fill(0.0);
        for (index, weight) in weights.iter().enumerate() {
            self.mean.iter_mut().zip(samples.point(index)).for_each(|(mean, x)| *mean += weight * x);
        }
        let effective = 1.0 - weights.iter().map(|w| w * w).sum::<f64>();
        if effective < 1e-9 {
            return;
        }
        let kept = self.settings.kept;
        self.covariance.iter_mut().for_each(|entry| *entry *= kept);
        for (index, weight) in weights.iter().enumerate() {
            let away: Vec<f64> = samples.point(index).iter().zip(&self.mean).map(|(x, m)| x - m).collect();
            for (column, entry) in self.covariance.chunks_exact_mut(n).zip(&away) {
                let factor = (1.0 - kept) * weight / effective * entry;
                column.iter_mut().zip(&away).for_each(|(c, away)| *c += factor * away);
            }
        }
        let eigen = symmetric_eigen(DMatrix::from_column_slice(n, n, &self.covariance));
        let mut root = eigen.vectors;
        for (mut column, value) in root.column_iter_mut().zip(&eigen.values) {
            column *= value.max(1e-300).sqrt();
        }
        self.root.copy_from_slice(root.as_slice());
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Search as _, tests::rollouts};
    use super::*;

    #[test]
    fn weights_have_the_relative_entropy_of_the_bound() {
        let rewards = [3.0, -1.0, 0.5, 2.5, 2.9, -40.0];
        for epsilon in [0.05, 0.5, 1.2] {
            let weights = entropic_weights(&rewards, epsilon);
            let found: f64 = weights.iter().map(|w| if *w > 0.0 { w * (w * 6.0).ln() } else { 0.0 }).sum();
            assert!((found - epsilon).abs() < 1e-9, "{epsilon}: {found}");
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            // the weights are exponentials of the rewards
            let eta = (3.0 - 2.5) / (weights[0] / weights[3]).ln();
            assert!(((3.0 - 0.5) / (weights[0] / weights[2]).ln() / eta - 1.0).abs() < 1e-9);
        }
        assert_eq!(entropic_weights(&[1.0, 1.0], 0.5), [0.5, 0.5]);
        assert_eq!(entropic_weights(&[f64::MIN, 1.0], 0.5), [0.0, 1.0]);
    }

    #[test]
    fn rotated_quadratic_is_descended() {
        let value =
            |x: &[f64]| -(x[0] + x[1] - 1.0).powi(2) - 20.0 * (x[0] - x[1] + 2.0).powi(2) - x[2] * x[2];
        let start = Start::new(vec![0.0, 0.0, 1.0], vec![1.0; 3], 1);
        let mut search = Reps::new(start, RepsSettings::default()).expect("a search");
        rollouts(&mut search, 4400, value);
        assert!(search.best().expect("rewards").1 > -1e-4, "{:?}", search.best());
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let start = Start::new(vec![0.0], vec![1.0], 1);
        let settings = RepsSettings { population: Some(4), epsilon: 2.0, ..RepsSettings::default() };
        let error = Reps::new(start, settings).expect_err("more than four candidates can lose");
        assert_eq!(error.to_string(), "setting `epsilon` is 2, expected above 0, below ln population");
    }
}
