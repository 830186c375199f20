//! Random search.

use std::collections::BTreeMap;

use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use super::{Best, Candidate, RestoreError, Saved, Search, StartError, TellError, check_bounds};
use crate::random::{Counter, Purpose};

/// Name of the method in saved states.
const METHOD: &str = "random";

/// A search with independent candidates that are uniformly distributed within bounds. This search is a
/// baseline for the other methods.
///
/// Source: Bergstra, Bengio, *Random search for hyper-parameter optimization*, JMLR 13, 2012.
///
/// ```
/// use motorium_learners::search::{Evaluation, RandomSearch, Search, TellError, Workers, maximise};
///
/// let mut search = RandomSearch::new(vec![[-1.0, 1.0], [0.0, 5.0]], 1)?;
/// let workers = Workers { threads: 2, ahead: 16, evaluations: 100 };
/// maximise::<_, _, TellError>(
///     &mut search,
///     workers,
///     |_| Ok(()),
///     |(), candidate| Ok(Evaluation::finished(candidate.parameters[1])),
///     |_, _, _| Ok(()),
/// )?;
/// assert!(search.best().expect("rewards").1 > 4.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RandomSearch {
    bounds: Vec<[f64; 2]>,
    seed: u64,
    /// Number of candidates so far.
    asked: u64,
    /// Candidates without rewards.
    pending: BTreeMap<u64, Vec<f64>>,
    best: Best,
}

impl RandomSearch {
    /// Creates a search within finite bounds. There is one pair of bounds per parameter.
    ///
    /// # Errors
    ///
    /// [`StartError`] if bounds are missing, not finite or out of order.
    pub fn new(bounds: Vec<[f64; 2]>, seed: u64) -> Result<Self, StartError> {
        check_bounds(&bounds)?;
        Ok(Self { bounds, seed, asked: 0, pending: BTreeMap::new(), best: Best::default() })
    }

    fn candidate(&self, id: u64, parameters: Vec<f64>) -> Candidate {
        let counter = Counter { seed: self.seed, step: id, ..Counter::default() };
        Candidate { id, parameters, seed: counter.number(Purpose::Rollout) }
    }
}

impl Search for RandomSearch {
    fn dimensions(&self) -> usize {
        self.bounds.len()
    }

    fn ask(&mut self, count: usize) -> Vec<Candidate> {
        // limit the request: there is always one more point
        let count = count.min(1024) as u64;
        let asked: Vec<Candidate> = (self.asked..self.asked + count)
            .map(|id| {
                let counter = Counter { seed: self.seed, step: id, ..Counter::default() };
                let mut random = counter.stream(Purpose::Candidate);
                let draw = |[low, high]: &[f64; 2]| {
                    let unit: f64 = random.random();
                    (low + unit * (high - low)).clamp(*low, *high)
                };
                self.candidate(id, self.bounds.iter().map(draw).collect())
            })
            .collect();
        self.asked += count;
        self.pending.extend(asked.iter().map(|candidate| (candidate.id, candidate.parameters.clone())));
        asked
    }

    fn tell(&mut self, rewards: &[(u64, f64)]) -> Result<(), TellError> {
        let mut seen = Vec::with_capacity(rewards.len());
        for (id, _) in rewards {
            if seen.contains(id) || (*id < self.asked && !self.pending.contains_key(id)) {
                return Err(TellError::Repeated { id: *id });
            }
            if *id >= self.asked {
                let first = self.pending.keys().next().copied().unwrap_or(self.asked);
                return Err(TellError::Unknown { id: *id, first, last: self.asked.saturating_sub(1) });
            }
            seen.push(*id);
        }
        for (id, reward) in rewards {
            if let Some(parameters) = self.pending.remove(id) {
                self.best.record(*id, &parameters, *reward);
            }
        }
        Ok(())
    }

    fn pending(&self) -> Vec<Candidate> {
        self.pending.iter().map(|(id, parameters)| self.candidate(*id, parameters.clone())).collect()
    }

    fn best(&self) -> Option<(&[f64], f64)> {
        self.best.get()
    }

    fn save(&self) -> String {
        Saved::write(METHOD, self)
    }

    fn restore(&mut self, state: &str) -> Result<(), RestoreError> {
        *self = Saved::<Self>::read(METHOD, self.dimensions(), state)?;
        Ok(())
    }
}
