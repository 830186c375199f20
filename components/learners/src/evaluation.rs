//! Evaluation of policies on a task.

use std::path::{Path, PathBuf};

use motorium_robots::ModelWarning;
use rand::RngExt as _;
use serde::Serialize;

use crate::environment::{End, Environment, EnvironmentError, Scene, SceneError};
use crate::files::{self, FileError};
use crate::folder::{self, FolderError};
use crate::random::{Counter, Purpose};
use crate::task::{Task, TaskError};
use crate::trained::{self, TrainedPolicyError};

/// Number of resamples of a bootstrap interval.
const RESAMPLES: usize = 2000;

/// Returns of a policy over several episodes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Number of episodes.
    pub episodes: usize,
    /// Mean return.
    pub mean: f64,
    /// Median return.
    pub median: f64,
    /// Interquartile mean of the return: the mean of the middle half of all returns.
    pub iqm: f64,
    /// 95 % bootstrap interval of the interquartile mean.
    pub iqm_interval: [f64; 2],
    /// Mean length of an episode \[steps\].
    pub mean_length: f64,
    /// Number of failed episodes: a termination with the verdict `failure` ended them.
    pub failures: usize,
    /// Number of successful episodes: a termination with the verdict `success` ended them.
    pub successes: usize,
    /// Return of each episode, in the order of the episodes.
    pub returns: Vec<f64>,
    /// Warnings about ignored elements of the world's file.
    #[serde(skip)]
    pub warnings: Vec<ModelWarning>,
}

/// Error of an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder contains no policy.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The task is invalid.
    #[error("{}: {source}", file.display())]
    Task {
        /// Path of the task file.
        file: PathBuf,
        /// Reason why the task is invalid.
        source: TaskError,
    },
    /// The policy does not fit the task.
    #[error(transparent)]
    Policy(#[from] TrainedPolicyError),
    /// The robot cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
}

/// Evaluates a policy without exploration: runs a number of episodes of the task in a file with the policy in
/// a folder.
///
/// # Errors
///
/// [`EvaluationError`] if the policy or the task cannot be loaded, they do not match, or an episode cannot
/// start.
pub fn evaluate(
    folder: &Path,
    task_file: &Path,
    episodes: usize,
    seed: u64,
) -> Result<Evaluation, EvaluationError> {
    folder::check_policy(folder)?;
    let invalid = |source| EvaluationError::Task { file: task_file.to_path_buf(), source };
    let task = Task::parse(&files::read_text(task_file)?).map_err(invalid)?;
    let mut network = trained::load(folder, &task)?;
    let scene = Scene::load(&task, &folder::base(task_file))?;
    let simulation = scene.simulation().map_err(EnvironmentError::from)?;
    let mut environment = Environment::new(&task, simulation, seed, 0)?;
    let (mut returns, mut steps, mut failures, mut successes) = (vec![], 0_usize, 0, 0);
    for _ in 0..episodes {
        network.reset();
        let episode = environment.run_episode(|observation, action| {
            network.observation_mut().copy_from_slice(observation);
            action.copy_from_slice(network.run());
        })?;
        returns.push(episode.total);
        steps += episode.steps;
        failures += usize::from(episode.end == End::Failure);
        successes += usize::from(episode.end == End::Success);
    }
    let count = episodes.max(1) as f64;
    Ok(Evaluation {
        episodes,
        mean: returns.iter().sum::<f64>() / count,
        median: quantile(&returns, 0.5),
        iqm: interquartile_mean(&returns),
        iqm_interval: bootstrap(&returns, seed, interquartile_mean),
        mean_length: steps as f64 / count,
        failures,
        successes,
        returns,
        warnings: scene.warnings().to_vec(),
    })
}

/// Comparison of a policy with a baseline on the same episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean difference, over all episodes, between the return of the policy and the return of the baseline.
    pub difference: f64,
    /// 95 % bootstrap interval of the difference.
    pub difference_interval: [f64; 2],
    /// Fraction of the episodes in which the policy's return exceeds the baseline's. An episode with equal
    /// returns counts half.
    pub improved: f64,
}

/// Compares the returns of a policy (`other`) with the returns of a baseline, episode by episode. Policy and
/// baseline must have been evaluated on the same task with the same seed. Returns `None` if the numbers of
/// episodes differ or are 0.
pub fn compare(baseline: &Evaluation, other: &Evaluation, seed: u64) -> Option<Comparison> {
    if baseline.returns.len() != other.returns.len() || baseline.returns.is_empty() {
        return None;
    }
    let pairs = || other.returns.iter().zip(&baseline.returns);
    let differences: Vec<f64> = pairs().map(|(other, baseline)| other - baseline).collect();
    let improved = pairs().map(|(other, baseline)| match other.total_cmp(baseline) {
        core::cmp::Ordering::Greater => 1.0,
        core::cmp::Ordering::Equal => 0.5,
        core::cmp::Ordering::Less => 0.0,
    });
    Some(Comparison {
        difference: mean(&differences),
        difference_interval: bootstrap(&differences, seed, mean),
        improved: improved.sum::<f64>() / differences.len() as f64,
    })
}

/// Returns the mean of at least one value.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Returns a quantile, interpolated between the two nearest values; NaN if there are no values. `share` is
/// the quantile's fraction, 0 to 1.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let sorted = sorted(values);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    sorted[low] + (place - low as f64) * (sorted[high] - sorted[low])
}

/// Returns the mean of the values without the lowest and the highest quarter, rounded down.
fn interquartile_mean(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    let cut = sorted.len() / 4;
    let middle = &sorted[cut..sorted.len() - cut];
    middle.iter().sum::<f64>() / middle.len() as f64
}

/// Returns the interval that contains 95 % of the values of a statistic over resamples.
fn bootstrap(values: &[f64], seed: u64, statistic: impl Fn(&[f64]) -> f64) -> [f64; 2] {
    let mut random = Counter { seed, ..Counter::default() }.stream(Purpose::Resample);
    let mut found = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let sample: Vec<f64> = values.iter().map(|_| values[random.random_range(0..values.len())]).collect();
        found.push(statistic(&sample));
    }
    [quantile(&found, 0.025), quantile(&found, 0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_match_known_values() {
        let values = [4.0, 1.0, 100.0, 2.0, 3.0, 5.0, -50.0, 6.0];
        assert_eq!(quantile(&values, 0.5), 3.5);
        assert_eq!(quantile(&values, 1.0), 100.0);
        assert_eq!(interquartile_mean(&values), 3.5);
        assert_eq!(interquartile_mean(&[7.0]), 7.0);
    }

    #[test]
    fn bootstrap_intervals_cover_the_mean_of_even_samples() {
        // 400 values spread evenly over [-1, 3]
        let values: Vec<f64> =
            (0..400).map(|k| 1.0 + (f64::from(k) * 0.618_033_988_75).fract() * 4.0 - 2.0).collect();
        let [low, high] = bootstrap(&values, 1, interquartile_mean);
        assert!(low < 1.0 && 1.0 < high && high - low < 0.6, "{low} {high}");
        assert_eq!(bootstrap(&values, 1, interquartile_mean), [low, high]);
    }

    fn evaluation(returns: Vec<f64>) -> Evaluation {
        Evaluation {
            episodes: returns.len(),
            mean: mean(&returns),
            median: quantile(&returns, 0.5),
            iqm: interquartile_mean(&returns),
            iqm_interval: bootstrap(&returns, 1, interquartile_mean),
            mean_length: 1.0,
            failures: 0,
            successes: 0,
            returns,
            warnings: vec![],
        }
    }

    #[test]
    fn comparisons_pair_equal_episodes() {
        // episodes differ by far more than the policies
        let hard: Vec<f64> = (0..50).map(|k| f64::from(k * k)).collect();
        let better: Vec<f64> = hard.iter().map(|value| value + 2.0).collect();
        let found = compare(&evaluation(hard.clone()), &evaluation(better), 1).expect("equal episodes");
        assert!((found.difference - 2.0).abs() < 1e-12 && found.improved == 1.0, "{found:?}");
        assert!(found.difference_interval.iter().all(|bound| (bound - 2.0).abs() < 1e-9), "{found:?}");
        let same = compare(&evaluation(hard.clone()), &evaluation(hard.clone()), 1).expect("equal episodes");
        assert_eq!((same.difference, same.improved), (0.0, 0.5));
        assert_eq!(compare(&evaluation(hard), &evaluation(vec![1.0]), 1), None);
    }
}
