//! Gradient ascent by finite differences.

use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`FiniteDifferences`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FiniteDifferencesSettings {
    /// Half the distance between the candidates of a pair, in initial deviations, more than 0. Default 0.1.
    pub step: f64,
    /// Factor of the reward gradient in an update, with parameters in units of the initial deviations, more
    /// than 0. Default 0.1.
    pub rate: f64,
    /// Maximum length of an update, in initial deviations, more than 0. This maximum limits the effect of a
    /// steep reward. Default 1.
    pub longest: f64,
}

impl Default for FiniteDifferencesSettings {
    fn default() -> Self {
        Self { step: 0.1, rate: 0.1, longest: 1.0 }
    }
}

/// Gradient ascent by central differences along every parameter, in units `u` of the initial deviation:
///
/// ```text
/// g_i = (R(u + step e_i) - R(u - step e_i)) / (2 step)
/// u'  = u + rate g, at most `longest` long
/// ```
///
/// All `2 n` candidates of a generation have the same [seed](super::Candidate::seed). If the evaluations of a
/// pair use the same random numbers, the noise cancels in their difference.
///
/// Source: Spall, *Introduction to stochastic search and optimization*, Wiley 2003, sections 6.3 and 14.4.
pub type FiniteDifferences = Generations<Differences>;

/// Search distribution of [`FiniteDifferences`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Differences {
    settings: FiniteDifferencesSettings,
    mean: Vec<f64>,
}

impl FiniteDifferences {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: FiniteDifferencesSettings) -> Result<Self, StartError> {
        let FiniteDifferencesSettings { step, rate, longest } = settings;
        for (key, value) in [("step", step), ("rate", rate), ("longest", longest)] {
            StartError::check(key, value, value > 0.0 && value.is_finite(), "above 0")?;
        }
        Self::build(start, |start| Ok(Differences { settings, mean: vec![0.0; start.dimensions()] }))
    }
}

impl Distribution for Differences {
    const METHOD: &'static str = "finite-differences";

    const COMMON_RANDOM_NUMBERS: bool = true;

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        2 * self.mean.len()
    }

    fn sample(&mut self, index: usize, _: &mut Pcg64, point: &mut [f64]) {
        point.copy_from_slice(&self.mean);
        let sign = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        point[index / 2] += sign * self.settings.step;
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        let FiniteDifferencesSettings { step, rate, longest } = self.settings;
        let change = |pair: &[f64]| {
            // a failed evaluation provides no slope
            let is_known = pair.iter().all(|reward| *reward > f64::MIN);
            if is_known { rate * (pair[0] - pair[1]) / (2.0 * step) } else { 0.0 }
        };
        let changes: Vec<f64> = samples.rewards.chunks_exact(2).map(change).collect();
        let length = changes.iter().map(|c| c * c).sum::<f64>().sqrt();
        let factor = if length > longest { longest / length } else { 1.0 };
        self.mean.iter_mut().zip(&changes).for_each(|(mean, change)| *mean += factor * change);
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Search as _, tests::rollouts};
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    #[test]
    fn gradients_of_a_quadratic_are_exact() {
        let settings = FiniteDifferencesSettings { step: 0.5, rate: 0.25, longest: 10.0 };
        let start = Start::new(vec![1.0, 2.0], vec![1.0, 2.0], 0);
        let mut search = FiniteDifferences::new(start, settings).expect("a search");
        rollouts(&mut search, 4, |x| -x[0] * x[0] - x[1] * x[1]);
        // du = -rate (2 x dx/du)
        assert_eq!(search.mean(), [1.0 - 0.25 * 2.0, 2.0 - 2.0 * 0.25 * 4.0 * 2.0]);
    }

    #[test]
    fn common_random_numbers_cancel_shared_noise() {
        let start = Start::new(vec![2.0; 3], vec![1.0; 3], 4);
        let mut search =
            FiniteDifferences::new(start, FiniteDifferencesSettings::default()).expect("a search");
        for _ in 0..60 {
            let rewards: Vec<(u64, f64)> = search
                .ask(6)
                .iter()
                .map(|c| {
                    let noise: f64 = Pcg64::seed_from_u64(c.seed).random();
                    (c.id, 100.0 * noise - c.parameters.iter().map(|x| x * x).sum::<f64>())
                })
                .collect();
            search.tell(&rewards).expect("known candidates");
        }
        assert!(search.mean().iter().all(|x| x.abs() < 1e-4), "{:?}", search.mean());
    }
}
