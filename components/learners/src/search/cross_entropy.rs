//! The cross-entropy method.

use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`CrossEntropy`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrossEntropySettings {
    /// Number of candidates per generation, at least 1. Default 20.
    pub population: usize,
    /// Fraction of each generation that forms the elite: the best candidates, from which the next
    /// distribution is estimated. More than 0, at most 1. Default 0.25.
    pub elite: f64,
    /// Weight of the elite in the next mean and deviation. More than 0, at most 1. Default 0.7. Smaller
    /// values search longer and are less sensitive to noise.
    pub smoothing: f64,
    /// Minimum deviation, as a fraction of the initial deviation. Default 0.02, so that the search never
    /// stalls.
    pub least: f64,
}

impl Default for CrossEntropySettings {
    fn default() -> Self {
        Self { population: 20, elite: 0.25, smoothing: 0.7, least: 0.02 }
    }
}

/// The cross-entropy method: a normal distribution moves towards the best candidates of each generation.
///
/// A generation is sampled from `N(mean, diag(deviation^2))` and clamped to the bounds; the very first
/// candidate is the mean. With the mean `m` and the standard deviation `s` of the elite, and the smoothing
/// `a`:
///
/// ```text
/// mean'      = a m + (1 - a) mean
/// deviation' = max(a s + (1 - a) deviation, least deviation)
/// ```
///
/// Only the order of the rewards matters.
///
/// Source: Rubinstein, *The cross-entropy method for combinatorial and continuous optimization*, Methodology
/// and Computing in Applied Probability 1, 1999; the smoothing after de Boer, Kroese, Mannor, Rubinstein, *A
/// tutorial on the cross-entropy method*, Annals of Operations Research 134, 2005.
pub type CrossEntropy = Generations<Elite>;

/// Search distribution of [`CrossEntropy`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Elite {
    settings: CrossEntropySettings,
    /// Bounds; `None` if infinite.
    bounds: Vec<[Option<f64>; 2]>,
    mean: Vec<f64>,
    deviation: Vec<f64>,
    is_first: bool,
}

impl CrossEntropy {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: CrossEntropySettings) -> Result<Self, StartError> {
        let CrossEntropySettings { population, elite, smoothing, least } = settings;
        let share = |value: f64| value > 0.0 && value <= 1.0;
        StartError::check("population", population as f64, population > 0, "at least 1")?;
        StartError::check("elite", elite, share(elite), "above 0, at most 1")?;
        StartError::check("smoothing", smoothing, share(smoothing), "above 0, at most 1")?;
        StartError::check("least", least, (0.0..=1.0).contains(&least), "0 to 1")?;
        Self::build(start, |start| {
            let n = start.dimensions();
            let bounds = (0..n)
                .map(|index| start.unit_bounds(index).map(|bound| Some(bound).filter(|b| b.is_finite())))
                .collect();
            Ok(Elite { settings, bounds, mean: vec![0.0; n], deviation: vec![1.0; n], is_first: true })
        })
    }
}

impl Distribution for Elite {
    const METHOD: &'static str = "cross-entropy";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.settings.population
    }

    fn sample(&mut self, index: usize, random: &mut Pcg64, point: &mut [f64]) {
        let explore = if index == 0 && self.is_first { 0.0 } else { 1.0 };
        let numbers = self.mean.iter().zip(&self.deviation).zip(&self.bounds);
        for (x, ((mean, deviation), [low, high])) in point.iter_mut().zip(numbers) {
            let noise: f64 = StandardNormal.sample(random);
            *x = mean + explore * deviation * noise;
            *x = x.max(low.unwrap_or(f64::NEG_INFINITY)).min(high.unwrap_or(f64::INFINITY));
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        self.is_first = false;
        let all = samples.rewards.len();
        let elite = ((self.settings.elite * all as f64).round() as usize).clamp(1, all);
        let (count, weight) = (elite as f64, self.settings.smoothing);
        for (i, (mean, deviation)) in self.mean.iter_mut().zip(&mut self.deviation).enumerate() {
            let values = || samples.order[..elite].iter().map(|index| samples.point(*index)[i]);
            let center = values().sum::<f64>() / count;
            let variance = values().map(|value| (value - center).powi(2)).sum::<f64>() / count;
            *mean = weight * center + (1.0 - weight) * *mean;
            *deviation = weight * variance.sqrt() + (1.0 - weight) * *deviation;
            *deviation = deviation.max(self.settings.least);
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

    fn search(seed: u64, population: usize) -> CrossEntropy {
        let start = Start::new(vec![2.0; 3], vec![1.0; 3], seed).within(vec![[-4.0, 4.0]; 3]);
        CrossEntropy::new(start, CrossEntropySettings { population, ..Default::default() }).expect("a search")
    }

    #[test]
    fn first_candidate_is_the_start_and_all_are_in_bounds() {
        let generation = search(1, 400).ask(400);
        assert_eq!(generation[0].parameters, [2.0; 3]);
        assert!(generation.iter().flat_map(|c| &c.parameters).all(|number| (-4.0..=4.0).contains(number)));
        assert!(generation.iter().any(|candidate| candidate.parameters[0] == 4.0), "some are on the bound");
    }

    #[test]
    fn elite_moves_mean_and_deviation_by_the_smoothing() {
        let settings = CrossEntropySettings { population: 4, elite: 0.5, smoothing: 0.5, least: 0.0 };
        let start = Start::new(vec![0.0], vec![1.0], 1);
        let search = CrossEntropy::new(start, settings).expect("a search");
        let mut elite = Elite { deviation: vec![2.0], ..search.distribution().clone() };
        let points = [1.0, -7.0, 3.0, -8.0];
        let samples = Samples { points: &points, rewards: &[5.0, 1.0, 4.0, f64::MIN], order: &[0, 2, 1, 3] };
        elite.update(&samples, &mut Pcg64::seed_from_u64(0));
        // elite 1 and 3: mean 2, deviation 1
        assert_eq!((elite.mean, elite.deviation), (vec![1.0], vec![1.5]));
    }

    #[test]
    fn optimum_of_a_function_with_ridges_is_found() {
        let value = |x: &[f64]| -(1.0 - x[0]).powi(2) - 5.0 * (x[1] - x[0] * x[0]).powi(2) - x[2].abs();
        let mut search = search(7, 40);
        rollouts(&mut search, 60 * 40, value);
        let best = search.best().expect("rewards").1;
        assert!(best > -0.05, "{best}");
    }

    #[test]
    fn equal_seeds_and_rewards_give_equal_candidates() {
        let run = |seed| {
            let mut search = search(seed, 8);
            rollouts(&mut search, 8, |theta| theta[0]);
            search.ask(8)
        };
        assert_eq!(run(5), run(5));
        assert_ne!(run(5), run(6));
    }
}
