//! The parts that gradient learners share: the [`Learner`] trait and checkpoints.
//!
//! A learner steps many worlds of a task and updates its networks. [`Algorithm`] names all of them, and
//! [`training`](crate::training) starts one by its name. Learners repeat to the bit: random numbers depend on
//! the seed and on counters alone, and the sums of a gradient run over fixed chunks of samples on any number
//! of threads.

mod algorithm;
mod checkpoint;
mod chunks;
mod costs;
mod episodes;
mod network;
mod normaliser;
mod schedule;
mod settings;

use serde::Serialize;

pub use algorithm::{Algorithm, UnknownAlgorithm};
pub use checkpoint::{CheckpointError, CheckpointReader, CheckpointWriter};
pub(crate) use chunks::{CHUNK, for_chunks, map_chunks};
pub use costs::{Costs, Phase, Stopwatch};
pub(crate) use episodes::Episodes;
pub use network::{Head, TrainedNetwork};
pub use normaliser::Normaliser;
pub use schedule::LinearSchedule;
pub(crate) use settings::{Check, read_settings, settings_table};

use crate::environment::EnvironmentError;

/// The errors of training.
#[derive(Debug, thiserror::Error)]
pub enum LearnerError {
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// A term of the loss is not finite.
    #[error(
        "update {update}: the {term} is {value}, expected a finite number\n\
         help: lower `rate` or clip the observations of the task"
    )]
    NotFinite {
        /// Number of the update.
        update: u64,
        /// Term of the loss.
        term: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Progress of a training run after an update.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// Updates so far.
    pub update: u64,
    /// Steps of all worlds together.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Mean return of the last 100 episodes, or `None` before the first end.
    pub mean_return: Option<f64>,
    /// Mean length of the last 100 episodes \[steps\].
    pub mean_length: Option<f64>,
    /// Values in the order of [`Learner::measures`], averaged over the update; NaN before the first gradient.
    pub values: Vec<f64>,
}

/// An algorithm that trains a policy by gradients.
pub trait Learner {
    /// The algorithm.
    fn algorithm(&self) -> Algorithm;

    /// Names of the values that an update measures, such as `policy_loss`.
    fn measures(&self) -> &'static [&'static str];

    /// Steps of all worlds so far.
    fn steps(&self) -> u64;

    /// Steps of all worlds in the whole run.
    fn total_steps(&self) -> u64;

    /// Updates so far.
    fn updates(&self) -> u64;

    /// Updates between two checkpoints.
    fn checkpoint_interval(&self) -> u64;

    /// True once all steps are made.
    fn is_finished(&self) -> bool {
        self.steps() >= self.total_steps()
    }

    /// Steps all worlds and updates the networks.
    ///
    /// # Errors
    ///
    /// [`LearnerError`]; [`LearnerError::NotFinite`] names the term of the loss.
    fn advance(&mut self) -> Result<Progress, LearnerError>;

    /// Time of all updates by phase, without [`Phase::Files`].
    fn costs(&self) -> Costs;

    /// The bytes of a checkpoint. The worlds are stored as the actions of their running episodes.
    ///
    /// # Errors
    ///
    /// [`CheckpointError::Format`].
    fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError>;

    /// Restores a checkpoint of a run with the same task and settings: the run then continues bit for bit.
    /// After an error the learner is unusable.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`].
    fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError>;

    /// The policy without exploration, on raw observations.
    fn policy(&self) -> TrainedNetwork;

    /// SHA-256 of all weights, in hexadecimal.
    fn weights_sha256(&self) -> String;
}

/// SHA-256 of some numbers, in hexadecimal.
pub(crate) fn numbers_sha256<'a>(numbers: impl IntoIterator<Item = &'a [f32]>) -> String {
    let bytes: Vec<u8> = numbers.into_iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    motorium_models::sha256::sha256_hex(&bytes)
}

/// Checks that a term of a loss is finite.
pub(crate) fn check_finite(update: u64, term: &'static str, value: f64) -> Result<(), LearnerError> {
    if value.is_finite() { Ok(()) } else { Err(LearnerError::NotFinite { update, term, value }) }
}

/// Sizes of the layers of a network.
pub(crate) fn layer_sizes(inputs: usize, hidden: &[usize], outputs: usize) -> Vec<usize> {
    core::iter::once(inputs).chain(hidden.iter().copied()).chain([outputs]).collect()
}
