//! Counter-based random numbers: each number depends only on a counter, not on the order in which numbers are
//! drawn.
//!
//! ```
//! use motorium_learners::random::{Counter, Purpose};
//! use rand::RngExt as _;
//!
//! let counter = Counter { seed: 1, world: 3, episode: 0, step: 17 };
//! let first: f64 = counter.stream(Purpose::Action).random();
//! let second: f64 = counter.stream(Purpose::Action).random();
//! assert_eq!(first, second);
//! let other: f64 = Counter { step: 18, ..counter }.stream(Purpose::Action).random();
//! assert_ne!(first, other);
//! ```

use core::hash::Hasher as _;

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use twox_hash::XxHash3_64;

/// Purpose of random numbers. Streams of different purposes are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Candidates of a search.
    Candidate = 1,
    /// Seed of the rollout of a candidate.
    Rollout = 2,
    /// Start of a search after a restart.
    Restart = 3,
    /// Points at which an acquisition function is evaluated.
    Acquisition = 4,
    /// Initial weights of a network.
    Weights = 5,
    /// Actions of a stochastic policy.
    Action = 6,
    /// Order of samples in an epoch.
    Shuffle = 7,
    /// Start of an episode.
    Start = 8,
    /// Resamples of statistics.
    Resample = 9,
    /// Commands of a task.
    Command = 10,
    /// Choice between an expert and its imitator.
    Mixture = 11,
    /// Samples of a replay buffer.
    Replay = 12,
    /// Noise of the actions in a gradient.
    Noise = 13,
    /// Pushes on a robot.
    Push = 14,
    /// Noise of measurements.
    Measurement = 15,
    /// Delay of actions.
    Delay = 16,
    /// Noise of cameras.
    Camera = 17,
}

/// Position in a training run for which random numbers are generated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counter {
    /// Seed of the run.
    pub seed: u64,
    /// Index of the world; for a search, index of the restart.
    pub world: u64,
    /// Number of the episode in its world; for a search, number of the generation.
    pub episode: u64,
    /// Number of the step in its episode; for a search, number of the candidate.
    pub step: u64,
}

impl Counter {
    /// Returns a generator of the random numbers for a purpose at this position.
    pub fn stream(self, purpose: Purpose) -> Pcg64 {
        Pcg64::seed_from_u64(self.number(purpose))
    }

    /// Returns a uniformly distributed number for a purpose at this position, which can serve as the seed of
    /// an episode.
    pub fn number(self, purpose: Purpose) -> u64 {
        let mut digest = XxHash3_64::default();
        for part in [self.seed, self.world, self.episode, self.step, purpose as u64] {
            digest.write(&part.to_le_bytes());
        }
        digest.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt as _;

    #[test]
    fn every_part_of_a_counter_changes_the_numbers() {
        let counter = Counter { seed: 1, world: 2, episode: 3, step: 4 };
        let numbers = [
            counter.number(Purpose::Action),
            counter.number(Purpose::Weights),
            Counter { seed: 2, ..counter }.number(Purpose::Action),
            Counter { world: 3, ..counter }.number(Purpose::Action),
            Counter { episode: 4, ..counter }.number(Purpose::Action),
            Counter { step: 5, ..counter }.number(Purpose::Action),
            Counter { seed: 2, world: 1, ..counter }.number(Purpose::Action),
        ];
        for (index, number) in numbers.iter().enumerate() {
            assert!(!numbers[..index].contains(number), "counter {index}");
        }
    }

    #[test]
    fn first_numbers_of_consecutive_counters_are_uniform() {
        let first = |step| -> f64 {
            Counter { seed: 9, step, ..Counter::default() }.stream(Purpose::Candidate).random()
        };
        let numbers: Vec<f64> = (0..4000).map(first).collect();
        let mean = numbers.iter().sum::<f64>() / 4000.0;
        let product = numbers.windows(2).map(|pair| (pair[0] - 0.5) * (pair[1] - 0.5)).sum::<f64>() / 3999.0;
        // five standard deviations
        assert!((mean - 0.5).abs() < 5.0 * (1.0_f64 / 12.0 / 4000.0).sqrt(), "{mean}");
        assert!(product.abs() < 5.0 / 12.0 / 4000.0_f64.sqrt(), "{product}");
    }
}
