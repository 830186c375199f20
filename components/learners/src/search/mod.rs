//! Black-box search: maximises a reward over parameters, using only rewards.
//!
//! All methods implement [`Search`]: `ask` proposes candidates, `tell` accepts their rewards in any order,
//! and `save` and `restore` continue a search bit for bit.
//!
//! - [`CmaEs`]: covariance matrix adaptation with BIPOP restarts.
//! - [`SeparableNes`], [`ExponentialNes`]: natural evolution strategies (SNES, xNES).
//! - [`CrossEntropy`]: the cross-entropy method.
//! - [`Power`]: policy learning by weighting exploration with the returns (PoWER).
//! - [`Reps`]: episodic relative entropy policy search.
//! - [`PathIntegral`]: black-box policy improvement by path integrals (PI^BB).
//! - [`FiniteDifferences`]: gradient ascent by central differences with common random numbers.
//! - [`BayesianOptimisation`]: a Gaussian process and an acquisition function.
//! - [`RandomSearch`]: uniform candidates, as a baseline.
//!
//! All methods except the last two are [`Generations`] of a [`Distribution`], which sample whole generations
//! of candidates. [`maximise`] evaluates candidates on several threads.
//!
//! ```
//! use motorium_learners::search::{CmaEs, CmaEsSettings, Search, Start};
//!
//! let start = Start::new(vec![0.0; 2], vec![1.0; 2], 7);
//! let mut search = CmaEs::new(start, CmaEsSettings::default())?;
//! for _ in 0..60 {
//!     let rewards: Vec<(u64, f64)> = search
//!         .ask(usize::MAX)
//!         .iter()
//!         .map(|c| (c.id, -(c.parameters[0] - 1.0).powi(2) - (c.parameters[1] + 2.0).powi(2)))
//!         .collect();
//!     search.tell(&rewards)?;
//! }
//! let (best, reward) = search.best().expect("rewards");
//! assert!(reward > -1e-6, "{best:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bayesian;
mod cma;
mod cross_entropy;
mod finite_differences;
mod generations;
mod nes;
mod parallel;
mod path_integral;
mod power;
mod reps;
mod start;
mod uniform;

pub use bayesian::{Acquisition, BayesianOptimisation, BayesianSettings, Smoothness};
pub use cma::{CmaEs, CmaEsSettings, Covariance, Restarts};
pub use cross_entropy::{CrossEntropy, CrossEntropySettings, Elite};
pub use finite_differences::{Differences, FiniteDifferences, FiniteDifferencesSettings};
pub use generations::{Distribution, Generations, Samples};
pub use nes::{ExponentialNes, Natural, NaturalSeparable, NesSettings, SeparableNes};
pub use parallel::{Evaluation, Outcome, Workers, maximise};
pub use path_integral::{PathIntegral, PathIntegralSettings, SoftmaxMean};
pub use power::{Power, PowerSettings, Weighted};
pub use reps::{RelativeEntropy, Reps, RepsSettings};
use start::check_bounds;
pub use start::{Start, StartError};
pub use uniform::RandomSearch;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// A candidate that a search proposes.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Number of the candidate, counted from 0 in the order of the proposals.
    pub id: u64,
    /// Parameters to evaluate.
    pub parameters: Vec<f64>,
    /// Seed of the evaluation's random numbers. Candidates that are compared with common random numbers have
    /// the same seed.
    pub seed: u64,
}

/// A search for the parameters with the largest reward.
pub trait Search {
    /// Returns the number of parameters.
    fn dimensions(&self) -> usize;

    /// Proposes up to `count` candidates. Returns fewer candidates, or an empty list, if the method first
    /// needs rewards of earlier candidates.
    fn ask(&mut self, count: usize) -> Vec<Candidate>;

    /// Accepts rewards of candidates in any order. Each entry is a pair of a candidate number and its reward.
    /// A reward that is not finite ranks below all finite rewards.
    ///
    /// # Errors
    ///
    /// [`TellError`] if a candidate is unknown or already has a reward. In this case no reward of the call is
    /// accepted.
    fn tell(&mut self, rewards: &[(u64, f64)]) -> Result<(), TellError>;

    /// Returns the candidates without rewards, for example after an interrupted run.
    fn pending(&self) -> Vec<Candidate>;

    /// Returns the best parameters evaluated so far and their reward; `None` before the first finite reward.
    fn best(&self) -> Option<(&[f64], f64)>;

    /// Returns the complete state of the search as JSON.
    fn save(&self) -> String;

    /// Restores a saved state of a search with the same method and number of parameters. The search then
    /// continues bit for bit.
    ///
    /// # Errors
    ///
    /// [`RestoreError`] if the state is invalid, or its method or number of parameters differs. In this case
    /// the search is unchanged.
    fn restore(&mut self, state: &str) -> Result<(), RestoreError>;
}

/// Error of [`Search::tell`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TellError {
    /// The candidate does not exist, or its generation has ended.
    #[error("candidate {id} is unknown or its generation has ended, expected one of {first} to {last}")]
    Unknown {
        /// Number of the candidate.
        id: u64,
        /// Number of the first candidate without a reward.
        first: u64,
        /// Number of the last proposed candidate.
        last: u64,
    },
    /// The candidate already has a reward.
    #[error("candidate {id} has two rewards, expected one")]
    Repeated {
        /// Number of the candidate.
        id: u64,
    },
}

/// Error of [`Search::restore`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RestoreError {
    /// The text is not a saved state.
    #[error("the state does not parse: {0}")]
    Parse(String),
    /// The state belongs to a different search method.
    #[error("the state belongs to the method {found}, expected {expected}")]
    Method {
        /// Name of the method in the state.
        found: String,
        /// Name of the search's method.
        expected: String,
    },
    /// The state has a different number of parameters.
    #[error("the state has {found} parameters, expected {expected}")]
    Dimensions {
        /// Number of parameters in the state.
        found: usize,
        /// Number of parameters of the search.
        expected: usize,
    },
}

/// The best parameters so far, with the number of the candidate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Best(Option<(u64, Vec<f64>, f64)>);

impl Best {
    /// Records a finite reward. Among candidates with equal rewards, the earliest candidate is kept,
    /// regardless of the order in which rewards arrive.
    fn record(&mut self, id: u64, parameters: &[f64], reward: f64) {
        let is_better =
            |(first, _, best): &(u64, Vec<f64>, f64)| reward > *best || (reward == *best && id < *first);
        if reward.is_finite() && self.0.as_ref().is_none_or(is_better) {
            self.0 = Some((id, parameters.to_vec(), reward));
        }
    }

    fn get(&self) -> Option<(&[f64], f64)> {
        self.0.as_ref().map(|(_, parameters, reward)| (parameters.as_slice(), *reward))
    }
}

/// A saved search and the name of its method.
#[derive(Serialize, Deserialize)]
struct Saved<T> {
    method: String,
    search: T,
}

impl<T: Serialize> Saved<&T> {
    fn write(method: &str, search: &T) -> String {
        serde_json::to_string(&Saved { method: method.to_owned(), search })
            .expect("numbers, lists and texts serialise")
    }
}

impl<T: Search + DeserializeOwned> Saved<T> {
    /// Reads the state of a search with a given method and number of parameters.
    fn read(method: &str, expected: usize, state: &str) -> Result<T, RestoreError> {
        let parse = |error: serde_json::Error| RestoreError::Parse(error.to_string());
        let saved: Saved<serde_json::Value> = serde_json::from_str(state).map_err(parse)?;
        if saved.method != method {
            return Err(RestoreError::Method { found: saved.method, expected: method.to_owned() });
        }
        let search: T = serde_json::from_value(saved.search).map_err(parse)?;
        let found = search.dimensions();
        if found != expected {
            return Err(RestoreError::Dimensions { found, expected });
        }
        Ok(search)
    }
}

#[cfg(test)]
mod tests;
