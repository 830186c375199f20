//! Searches that sample generations of candidates from a distribution.

use std::collections::VecDeque;

use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{Best, Candidate, RestoreError, Saved, Search, Start, StartError, TellError};
use crate::random::{Counter, Purpose};

/// A complete generation: points with their rewards.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Coordinates of the points of the generation, point by point.
    pub points: &'a [f64],
    /// Reward of each point; all rewards are finite.
    pub rewards: &'a [f64],
    /// Indices of the points, sorted by decreasing reward; equal rewards are sorted by index.
    pub order: &'a [usize],
}

impl Samples<'_> {
    /// Returns the point with this index.
    pub fn point(&self, index: usize) -> &[f64] {
        let dimensions = self.points.len() / self.rewards.len();
        &self.points[index * dimensions..][..dimensions]
    }
}

/// A distribution over parameters that a search samples and updates.
///
/// Parameters are shifted and scaled by the start, so that the initial distribution has mean 0 and standard
/// deviation 1 in every direction.
pub trait Distribution: Serialize + DeserializeOwned {
    /// Name of the method in saved states.
    const METHOD: &'static str;

    /// `true` if all candidates of a generation are evaluated with the same random numbers.
    const COMMON_RANDOM_NUMBERS: bool = false;

    /// Returns the number of parameters.
    fn dimensions(&self) -> usize;

    /// Returns the number of candidates of the next generation.
    fn population(&self) -> usize;

    /// Writes the point of candidate `index` of a generation to `point`.
    fn sample(&mut self, index: usize, random: &mut Pcg64, point: &mut [f64]);

    /// Updates the distribution from a complete generation. Restarts draw random numbers from `random`.
    fn update(&mut self, samples: &Samples<'_>, random: &mut Pcg64);

    /// Writes the mean of the distribution to `mean`.
    fn mean(&self, mean: &mut [f64]);
}

/// A generation and its candidates.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Generation {
    /// Number of the generation.
    number: u64,
    /// Number of its first candidate.
    first: u64,
    population: usize,
    points: Vec<f64>,
    parameters: Vec<Vec<f64>>,
    rewards: Vec<Option<f64>>,
}

impl Generation {
    fn is_complete(&self) -> bool {
        self.rewards.len() == self.population && self.rewards.iter().all(Option::is_some)
    }
}

/// A search that samples generations of candidates from a [`Distribution`] and updates it from their rewards.
///
/// A generation ends when all its candidates have rewards; until then [`ask`](Search::ask) returns only the
/// remaining candidates of this generation. Results depend on the rewards, but not on the order in which they
/// arrive.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Generations<D: Distribution> {
    start: Start,
    distribution: D,
    /// Maximum number of open generations.
    ahead: usize,
    open: VecDeque<Generation>,
    /// Numbers of generations and candidates so far.
    generations: u64,
    candidates: u64,
    best: Best,
}

impl<D: Distribution> Generations<D> {
    /// Creates a search from `start`. `make` builds the distribution after the start has been checked.
    pub(super) fn build(
        start: Start,
        make: impl FnOnce(&Start) -> Result<D, StartError>,
    ) -> Result<Self, StartError> {
        start.check()?;
        let distribution = make(&start)?;
        Ok(Self {
            start,
            distribution,
            ahead: 1,
            open: VecDeque::new(),
            generations: 0,
            candidates: 0,
            best: Best::default(),
        })
    }

    /// Allows `count` generations (at least 1) to be open simultaneously, so that no worker waits for the
    /// last reward of a generation. The default of 1 is the exact method. With a larger count, later
    /// generations are sampled from a distribution that is `count - 1` updates old.
    #[must_use]
    pub fn with_open_generations(mut self, count: usize) -> Self {
        self.ahead = count.max(1);
        self
    }

    /// Returns the distribution, over parameters that are shifted and scaled by the start.
    pub fn distribution(&self) -> &D {
        &self.distribution
    }

    /// Returns the mean of the distribution, in units of the parameters.
    pub fn mean(&self) -> Vec<f64> {
        let mut unit = vec![0.0; self.start.dimensions()];
        self.distribution.mean(&mut unit);
        self.start.parameters(&unit)
    }

    /// Returns the number of finished generations.
    pub fn generations(&self) -> u64 {
        self.generations - self.open.len() as u64
    }

    fn counter(&self, episode: u64, step: u64) -> Counter {
        Counter { seed: self.start.seed, world: 0, episode, step }
    }

    /// Returns candidate `id` of a generation.
    fn candidate(&self, generation: u64, id: u64, parameters: Vec<f64>) -> Candidate {
        let common = if D::COMMON_RANDOM_NUMBERS { 0 } else { id };
        Candidate { id, parameters, seed: self.counter(generation, common).number(Purpose::Rollout) }
    }

    fn update(&mut self) {
        while self.open.front().is_some_and(Generation::is_complete) {
            let Some(generation) = self.open.pop_front() else { return };
            let rewards: Vec<f64> =
                generation.rewards.iter().map(|reward| reward.unwrap_or(f64::MIN)).collect();
            let mut order: Vec<usize> = (0..rewards.len()).collect();
            order.sort_by(|a, b| rewards[*b].total_cmp(&rewards[*a]));
            let samples = Samples { points: &generation.points, rewards: &rewards, order: &order };
            let mut random = self.counter(generation.number, 0).stream(Purpose::Restart);
            self.distribution.update(&samples, &mut random);
        }
    }
}

impl<D: Distribution> Search for Generations<D> {
    fn dimensions(&self) -> usize {
        self.start.dimensions()
    }

    fn ask(&mut self, count: usize) -> Vec<Candidate> {
        let mut asked = Vec::new();
        let mut point = vec![0.0; self.dimensions()];
        while asked.len() < count {
            let is_full = |last: &Generation| last.rewards.len() == last.population;
            if self.open.back().is_none_or(is_full) {
                if self.open.len() == self.ahead {
                    break;
                }
                self.open.push_back(Generation {
                    number: self.generations,
                    first: self.candidates,
                    population: self.distribution.population().max(1),
                    points: vec![],
                    parameters: vec![],
                    rewards: vec![],
                });
                self.generations += 1;
            }
            let Some(last) = self.open.back_mut() else { break };
            let (id, index, number) = (self.candidates, last.rewards.len(), last.number);
            let counter = Counter { seed: self.start.seed, world: 0, episode: number, step: id };
            self.distribution.sample(index, &mut counter.stream(Purpose::Candidate), &mut point);
            let parameters = self.start.parameters(&point);
            last.points.extend_from_slice(&point);
            last.parameters.push(parameters.clone());
            last.rewards.push(None);
            self.candidates += 1;
            asked.push(self.candidate(number, id, parameters));
        }
        asked
    }

    fn tell(&mut self, rewards: &[(u64, f64)]) -> Result<(), TellError> {
        let first = self.open.front().map_or(self.candidates, |generation| generation.first);
        let mut seen: Vec<u64> = rewards.iter().map(|(id, _)| *id).collect();
        seen.sort_unstable();
        if let Some(pair) = seen.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(TellError::Repeated { id: pair[0] });
        }
        let mut slots = Vec::with_capacity(rewards.len());
        for (id, _) in rewards {
            if !(first..self.candidates).contains(id) {
                let last = self.candidates.saturating_sub(1);
                return Err(TellError::Unknown { id: *id, first, last });
            }
            let generation = self.open.partition_point(|generation| generation.first <= *id) - 1;
            let index = (id - self.open[generation].first) as usize;
            if self.open[generation].rewards[index].is_some() {
                return Err(TellError::Repeated { id: *id });
            }
            slots.push((generation, index));
        }
        for ((generation, index), (id, reward)) in slots.into_iter().zip(rewards) {
            self.best.record(*id, &self.open[generation].parameters[index], *reward);
            let reward = if reward.is_finite() { *reward } else { f64::MIN };
            self.open[generation].rewards[index] = Some(reward);
        }
        self.update();
        Ok(())
    }

    fn pending(&self) -> Vec<Candidate> {
        let open = self.open.iter().flat_map(|generation| {
            let entries = generation.rewards.iter().zip(&generation.parameters).enumerate();
            let waiting = entries.filter(|(_, (reward, _))| reward.is_none());
            waiting.map(|(index, (_, parameters))| {
                self.candidate(generation.number, generation.first + index as u64, parameters.clone())
            })
        });
        open.collect()
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }

    fn save(&self) -> String {
        Saved::write(D::METHOD, self)
    }

    fn restore(&mut self, state: &str) -> Result<(), RestoreError> {
        *self = Saved::<Self>::read(D::METHOD, self.dimensions(), state)?;
        Ok(())
    }
}
