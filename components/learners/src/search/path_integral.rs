//! Black-box policy improvement by path integrals.

use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`PathIntegral`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathIntegralSettings {
    /// Number of candidates per generation, at least 2. Default 10.
    pub population: usize,
    /// Sharpness `h` of the softmax over the rewards, more than 0. Default 10.
    pub sharpness: f64,
    /// Factor applied to the deviation after every update, more than 0, at most 1. Default 0.95.
    pub decay: f64,
}

impl Default for PathIntegralSettings {
    fn default() -> Self {
        Self { population: 10, sharpness: 10.0, decay: 0.95 }
    }
}

/// A search by reward-weighted averaging of perturbed parameters (PI^BB).
///
/// ```text
/// w_i        ~ exp(h (R_i - max R) / (max R - min R))
/// mean'      = sum_i w_i x_i
/// deviation' = decay deviation
/// ```
///
/// Source: Stulp, Sigaud, *Robot skill learning: from reinforcement learning to evolution strategies*,
/// Paladyn Journal of Behavioral Robotics 4, 2013; defaults from the library `dmpbbo`.
pub type PathIntegral = Generations<SoftmaxMean>;

/// Search distribution of [`PathIntegral`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SoftmaxMean {
    settings: PathIntegralSettings,
    mean: Vec<f64>,
    deviation: f64,
}

impl PathIntegral {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: PathIntegralSettings) -> Result<Self, StartError> {
        let PathIntegralSettings { population, sharpness, decay } = settings;
        StartError::check("population", population as f64, population >= 2, "at least 2")?;
        StartError::check("sharpness", sharpness, sharpness > 0.0 && sharpness.is_finite(), "above 0")?;
        StartError::check("decay", decay, decay > 0.0 && decay <= 1.0, "above 0, at most 1")?;
        Self::build(start, |start| {
            Ok(SoftmaxMean { settings, mean: vec![0.0; start.dimensions()], deviation: 1.0 })
        })
    }
}

impl Distribution for SoftmaxMean {
    const METHOD: &'static str = "path-integral";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.settings.population
    }

    fn sample(&mut self, _: usize, random: &mut Pcg64, point: &mut [f64]) {
        for (x, mean) in point.iter_mut().zip(&self.mean) {
            let noise: f64 = StandardNormal.sample(random);
            *x = mean + self.deviation * noise;
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        let best = samples.rewards[samples.order[0]];
        let finite = samples.rewards.iter().copied().filter(|reward| *reward > f64::MIN);
        let spread = best - finite.fold(best, f64::min);
        let weight = |reward: f64| {
            // equal rewards have equal weights
            if spread > 0.0 {
                (self.settings.sharpness * (reward - best) / spread).exp()
            } else if reward > f64::MIN || best == f64::MIN {
                1.0
            } else {
                0.0
            }
        };
        let weights: Vec<f64> = samples.rewards.iter().map(|reward| weight(*reward)).collect();
        let sum: f64 = weights.iter().sum();
        self.mean.fill(0.0);
        for (index, weight) in weights.iter().enumerate() {
            self.mean.iter_mut().zip(samples.point(index)).for_each(|(mean, x)| *mean += weight / sum * x);
        }
        self.deviation *= self.settings.decay;
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

    #[test]
    fn one_update_equals_the_softmax() {
        let settings = PathIntegralSettings { population: 3, sharpness: 2.0_f64.ln() * 2.0, decay: 0.5 };
        let mut found = SoftmaxMean { settings, mean: vec![0.0], deviation: 1.0 };
        let samples = Samples { points: &[1.0, 2.0, 3.0], rewards: &[5.0, 4.0, 3.0], order: &[0, 1, 2] };
        found.update(&samples, &mut Pcg64::seed_from_u64(0));
        // weights 4 : 2 : 1
        assert!((found.mean[0] - 11.0 / 7.0).abs() < 1e-14, "{:?}", found.mean);
        assert_eq!(found.deviation, 0.5);
        let failed = Samples { points: &[1.0, 2.0, 3.0], rewards: &[f64::MIN; 3], order: &[0, 1, 2] };
        found.update(&failed, &mut Pcg64::seed_from_u64(0));
        assert!((found.mean[0] - 2.0).abs() < 1e-14, "{:?}", found.mean);
    }

    #[test]
    fn sphere_is_descended() {
        let start = Start::new(vec![1.0, -1.0], vec![0.5; 2], 2);
        let mut search = PathIntegral::new(start, PathIntegralSettings::default()).expect("a search");
        rollouts(&mut search, 1000, |x| -x[0] * x[0] - x[1] * x[1]);
        assert!(search.best().expect("rewards").1 > -1e-3, "{:?}", search.best());
    }
}
