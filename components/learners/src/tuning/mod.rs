//! Tuning: a black-box search for parameters of a system. A tuning is stored in a folder and runs on several
//! threads.
//!
//! A [`Tuning`] proposes values of [`Parameter`]s, and a [`Subject`] evaluates them, for example with a graph
//! in an inline session. Every evaluation is a line of a table and is followed by a checkpoint, so an
//! interrupted tuning continues where it stopped. If the evaluations are reproducible, parameters and rewards
//! are bit-for-bit reproducible on any number of threads, even if the tuning is interrupted and resumed.
//!
//! On a robot, [`Tuning::attend`] runs one episode at a time. An [`Operator`] permits each episode and judges
//! its result.
//!
//! | file | content |
//! |---|---|
//! | `tuning.json` | settings, and the description of the subject |
//! | `evaluations.csv` | one line per evaluation: number, outcome, reward, parameters, reason for a failure |
//! | `checkpoint.json` | state of the search and the dialogue with an operator, number of evaluations |
//! | `best.toml` | the best parameters, in the format that the subject defines |

mod attended;
mod dialogue;
mod parameter;
mod run;

pub use attended::{Attendance, Operator};
pub use dialogue::{Action, AnswerError, Question, Stage};
pub use parameter::{Parameter, ParameterError, Scale};
pub use run::{FolderError, Progress, Subject, Summary, Tuning, TuningError};

use serde::{Deserialize, Serialize};

use crate::search::{
    BayesianOptimisation, BayesianSettings, CmaEs, CmaEsSettings, CrossEntropy, CrossEntropySettings,
    ExponentialNes, FiniteDifferences, FiniteDifferencesSettings, NesSettings, PathIntegral,
    PathIntegralSettings, Power, PowerSettings, RandomSearch, Reps, RepsSettings, Search, SeparableNes,
    Start, StartError,
};

/// Search method of a tuning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Covariance matrix adaptation with restarts.
    #[default]
    CmaEs,
    /// The cross-entropy method.
    CrossEntropy,
    /// Natural evolution strategy with one deviation per parameter.
    Snes,
    /// Natural evolution strategy with a full covariance.
    Xnes,
    /// Episodic relative entropy policy search.
    Reps,
    /// Path integral policy improvement with black-box averaging (PI^BB).
    PathIntegral,
    /// Policy learning by weighting exploration with the returns (PoWER). Rewards must be more than 0.
    Power,
    /// Gradient ascent by central differences.
    FiniteDifferences,
    /// Bayesian optimisation with a Gaussian process and expected improvement, for few, expensive
    /// evaluations.
    Bayesian,
    /// Random search: independent, uniformly distributed candidates. Serves as a baseline.
    Random,
}

/// Settings of a tuning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Parameters and their ranges, at least one.
    pub parameters: Vec<Parameter>,
    /// Search method. Default: CMA-ES.
    #[serde(default)]
    pub method: Method,
    /// Seed of the search.
    pub seed: u64,
    /// Total number of evaluations, at least 1.
    pub evaluations: u64,
    /// Number of simultaneous evaluations of a Bayesian search, at least 1. Each candidate is proposed before
    /// the rewards of the previous `together - 1` candidates are known. All methods other than Bayesian
    /// optimisation evaluate whole generations at once.
    pub together: usize,
}

impl Settings {
    /// Creates the search. The search starts in the middle of the ranges, with a standard deviation of a
    /// quarter of each range.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn search(&self) -> Result<Box<dyn Search>, StartError> {
        let bounds: Vec<[f64; 2]> = self.parameters.iter().map(Parameter::bounds).collect();
        let start = || {
            let mean = bounds.iter().map(|[low, high]| 0.5 * (low + high)).collect();
            let deviation = bounds.iter().map(|[low, high]| 0.25 * (high - low)).collect();
            Start::new(mean, deviation, self.seed).within(bounds.clone())
        };
        Ok(match self.method {
            Method::CmaEs => Box::new(CmaEs::new(start(), CmaEsSettings::default())?),
            Method::CrossEntropy => Box::new(CrossEntropy::new(start(), CrossEntropySettings::default())?),
            Method::Snes => Box::new(SeparableNes::new(start(), NesSettings::default())?),
            Method::Xnes => Box::new(ExponentialNes::new(start(), NesSettings::default())?),
            Method::Reps => Box::new(Reps::new(start(), RepsSettings::default())?),
            Method::PathIntegral => Box::new(PathIntegral::new(start(), PathIntegralSettings::default())?),
            Method::Power => Box::new(Power::new(start(), PowerSettings::default())?),
            Method::FiniteDifferences => {
                Box::new(FiniteDifferences::new(start(), FiniteDifferencesSettings::default())?)
            }
            Method::Bayesian => {
                Box::new(BayesianOptimisation::new(bounds, BayesianSettings::default(), self.seed)?)
            }
            Method::Random => Box::new(RandomSearch::new(bounds, self.seed)?),
        })
    }

    /// Returns the maximum number of candidates without rewards.
    fn ahead(&self) -> usize {
        match self.method {
            Method::Bayesian => self.together.max(1),
            // enough to keep any machine busy
            Method::Random => 256,
            _ => usize::MAX,
        }
    }

    /// Returns the values of the parameters at a point of the search.
    fn values(&self, point: &[f64]) -> Vec<f64> {
        self.parameters.iter().zip(point).map(|(parameter, x)| parameter.value(*x)).collect()
    }

    /// Returns the values in the middle of the ranges.
    pub fn middle(&self) -> Vec<f64> {
        let middle = |parameter: &Parameter| {
            let [low, high] = parameter.bounds();
            parameter.value(0.5 * (low + high))
        };
        self.parameters.iter().map(middle).collect()
    }
}

#[cfg(test)]
mod tests;
