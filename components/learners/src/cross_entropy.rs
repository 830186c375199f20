//! The cross-entropy method: a search by whole generations, whose candidates can be tried at the same time.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

/// Settings of [`CrossEntropy`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossEntropySettings {
    /// Share of a generation that the next one is drawn around: its best. Above 0, at most 1; default 0.25.
    pub elite: f64,
    /// Weight of the elite in the next mean and deviation, the rest being that of those before. Above 0, at
    /// most 1; default 0.7: smaller values search longer and are lost less easily to noise.
    pub smoothing: f64,
    /// Smallest deviation, as a share of the first. Default 0.02: the search does not come to a standstill.
    pub least: f64,
}

impl Default for CrossEntropySettings {
    fn default() -> Self {
        Self { elite: 0.25, smoothing: 0.7, least: 0.02 }
    }
}

/// A search for the parameters of the largest reward, one generation at a time.
///
/// A generation is drawn from `N(mean, diag(deviation^2))` and kept within bounds. With the mean `m` and the
/// standard deviation `s` of the best of them, and the smoothing `a`:
///
/// ```text
/// mean'      = a m + (1 - a) mean
/// deviation' = max(a s + (1 - a) deviation, least deviation)
/// ```
///
/// Only the order of the rewards matters. What is drawn depends on the seed and the rewards alone, not on the
/// order in which candidates are tried.
///
/// Source: Rubinstein, *The cross-entropy method for combinatorial and continuous optimization*, Methodology
/// and Computing in Applied Probability 1, 1999; the smoothing after de Boer, Kroese, Mannor, Rubinstein, *A
/// tutorial on the cross-entropy method*, Annals of Operations Research 134, 2005.
///
/// ```
/// use motorium_learners::{CrossEntropy, CrossEntropySettings};
///
/// // Finds the parameters (1, -2) from their reward alone.
/// let bounds = vec![[-5.0, 5.0]; 2];
/// let mut search = CrossEntropy::new(vec![0.0; 2], vec![1.0; 2], bounds, CrossEntropySettings::default(), 7);
/// for _ in 0..30 {
///     let generation = search.ask(20);
///     let reward = |theta: &Vec<f64>| -(theta[0] - 1.0).powi(2) - (theta[1] + 2.0).powi(2);
///     let rewards: Vec<f64> = generation.iter().map(reward).collect();
///     search.tell(&generation, &rewards);
/// }
/// let (best, reward) = search.best().unwrap();
/// assert!(reward > -0.01, "{best:?}");
/// ```
#[derive(Clone, Debug)]
pub struct CrossEntropy {
    settings: CrossEntropySettings,
    mean: Vec<f64>,
    first: Vec<f64>,
    deviation: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    best: Option<(Vec<f64>, f64)>,
    random: Pcg64,
}

impl CrossEntropy {
    /// A search that starts at `mean`, with a deviation and bounds for each parameter.
    ///
    /// # Panics
    /// When there are not as many deviations, or bounds, as parameters.
    pub fn new(
        mean: Vec<f64>,
        deviation: Vec<f64>,
        bounds: Vec<[f64; 2]>,
        settings: CrossEntropySettings,
        seed: u64,
    ) -> Self {
        assert_eq!(mean.len(), deviation.len(), "one deviation for each parameter");
        assert_eq!(mean.len(), bounds.len(), "bounds for each parameter");
        let random = Pcg64::seed_from_u64(seed);
        Self { settings, mean, first: deviation.clone(), deviation, bounds, best: None, random }
    }

    /// The candidates of the next generation. The first of the first generation is the initial mean.
    pub fn ask(&mut self, count: usize) -> Vec<Vec<f64>> {
        let draws_mean = self.best.is_none();
        (0..count)
            .map(|index| {
                let explore = index > 0 || !draws_mean;
                let numbers = self.mean.iter().zip(&self.deviation).zip(&self.bounds);
                numbers
                    .map(|((mean, deviation), [low, high])| {
                        let noise: f64 = StandardNormal.sample(&mut self.random);
                        let offset = if explore { deviation * noise } else { 0.0 };
                        (mean + offset).max(*low).min(*high)
                    })
                    .collect()
            })
            .collect()
    }

    /// Takes the rewards of a generation, one for each candidate; one that is not a number is the worst.
    ///
    /// # Panics
    /// When there are not as many rewards as candidates.
    pub fn tell(&mut self, generation: &[Vec<f64>], rewards: &[f64]) {
        assert_eq!(generation.len(), rewards.len(), "one reward for each candidate");
        let reward = |index: usize| if rewards[index].is_nan() { f64::NEG_INFINITY } else { rewards[index] };
        let mut order: Vec<usize> = (0..rewards.len()).collect();
        order.sort_by(|a, b| reward(*b).total_cmp(&reward(*a)));
        let Some(first) = order.first().copied() else { return };
        if self.best.as_ref().is_none_or(|(_, best)| reward(first) > *best) {
            self.best = Some((generation[first].clone(), reward(first)));
        }
        let elite = ((self.settings.elite * rewards.len() as f64).round() as usize).clamp(1, rewards.len());
        let (count, weight) = (elite as f64, self.settings.smoothing);
        let before = self.mean.iter_mut().zip(&mut self.deviation).zip(&self.first).enumerate();
        for (i, ((mean, deviation), first)) in before {
            let values = || order[..elite].iter().map(|index| generation[*index][i]);
            let of_elite = values().sum::<f64>() / count;
            let variance = values().map(|value| (value - of_elite).powi(2)).sum::<f64>() / count;
            *mean = weight * of_elite + (1.0 - weight) * *mean;
            *deviation = weight * variance.sqrt() + (1.0 - weight) * *deviation;
            *deviation = deviation.max(self.settings.least * first);
        }
    }

    /// The best parameters seen, and their reward.
    pub fn best(&self) -> Option<(&[f64], f64)> {
        self.best.as_ref().map(|(theta, reward)| (theta.as_slice(), *reward))
    }

    /// Mean of the next generation.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Standard deviation of the next generation.
    pub fn deviation(&self) -> &[f64] {
        &self.deviation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(seed: u64) -> CrossEntropy {
        let bounds = vec![[-4.0, 4.0]; 3];
        CrossEntropy::new(vec![2.0; 3], vec![1.0; 3], bounds, CrossEntropySettings::default(), seed)
    }

    #[test]
    fn the_first_candidate_is_where_the_search_starts_and_none_is_out_of_bounds() {
        let generation = search(1).ask(400);
        assert_eq!(generation[0], [2.0; 3]);
        assert!(generation.iter().flatten().all(|number| (-4.0..=4.0).contains(number)));
        assert!(generation.iter().any(|theta| theta[0] == 4.0), "some lie on the bound");
    }

    #[test]
    fn a_generation_moves_to_the_mean_of_its_best_by_the_smoothing() {
        let settings = CrossEntropySettings { elite: 0.5, smoothing: 0.5, least: 0.0 };
        let mut search = CrossEntropy::new(vec![0.0], vec![2.0], vec![[-9.0, 9.0]], settings, 1);
        search.tell(&[vec![1.0], vec![-7.0], vec![3.0], vec![-8.0]], &[5.0, 1.0, 4.0, f64::NAN]);
        // elite 1 and 3: mean 2, deviation 1
        assert_eq!((search.mean(), search.deviation()), (&[1.0][..], &[1.5][..]));
        assert_eq!(search.best(), Some((&[1.0][..], 5.0)));
    }

    #[test]
    fn it_finds_the_optimum_of_a_function_with_ridges() {
        let mut search = search(3);
        let value = |x: &[f64]| -(1.0 - x[0]).powi(2) - 5.0 * (x[1] - x[0] * x[0]).powi(2) - x[2].abs();
        for _ in 0..60 {
            let generation = search.ask(40);
            let rewards: Vec<f64> = generation.iter().map(|theta| value(theta)).collect();
            search.tell(&generation, &rewards);
        }
        let (best, reward) = search.best().unwrap();
        assert!(reward > -0.05, "{best:?}: {reward}");
    }

    #[test]
    fn equal_seeds_and_rewards_give_equal_candidates() {
        let run = |seed| {
            let mut search = search(seed);
            let generation = search.ask(8);
            let rewards: Vec<f64> = generation.iter().map(|theta| theta[0]).collect();
            search.tell(&generation, &rewards);
            search.ask(8)
        };
        assert_eq!(run(5), run(5));
        assert_ne!(run(5), run(6));
    }
}
