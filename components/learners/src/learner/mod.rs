//! Shared parts of gradient-based learners: the [`Learner`] trait and checkpoints.
//!
//! A learner steps many worlds of a task and updates its networks. [`Algorithm`] lists all learners, and
//! [`training`](crate::training) starts a learner by its name. Results are bit-for-bit reproducible on any
//! number of threads: random numbers depend only on the seed and on counters, and gradients are summed over
//! fixed chunks of samples.

mod algorithm;
mod checkpoint;
mod chunks;
mod costs;
mod encoding;
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
pub use encoding::ConvolutionSettings;
pub(crate) use encoding::{Encoding, check_convolutions};
pub(crate) use episodes::Episodes;
pub(crate) use network::log_sum;
pub use network::{Head, TrainedNetwork};
pub use normaliser::Normaliser;
pub use schedule::LinearSchedule;
pub(crate) use settings::{Check, read_settings, settings_table};

use crate::environment::EnvironmentError;

/// Error of training.
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
        /// Name of the term.
        term: &'static str,
        /// Value of the term.
        value: f64,
    },
}

/// Progress of a training run after an update.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// Number of updates so far.
    pub update: u64,
    /// Number of steps so far, in all worlds together.
    pub steps: u64,
    /// Number of finished episodes so far.
    pub episodes: u64,
    /// Mean return of the last 100 episodes; `None` before the first episode ends.
    pub mean_return: Option<f64>,
    /// Mean length of the last 100 episodes \[steps\]; `None` before the first episode ends.
    pub mean_length: Option<f64>,
    /// Measured values in the order of [`Learner::measures`], averaged over the update; NaN before the first
    /// gradient.
    pub values: Vec<f64>,
}

/// A gradient-based algorithm that trains a policy.
pub trait Learner {
    /// Returns the algorithm.
    fn algorithm(&self) -> Algorithm;

    /// Returns the names of the values that are measured in each update, such as `policy_loss`.
    fn measures(&self) -> &'static [&'static str];

    /// Returns the number of steps so far, in all worlds together.
    fn steps(&self) -> u64;

    /// Returns the number of steps of the complete run, in all worlds together.
    fn total_steps(&self) -> u64;

    /// Returns the number of updates so far.
    fn updates(&self) -> u64;

    /// Returns the number of updates between two checkpoints.
    fn checkpoint_interval(&self) -> u64;

    /// Returns `true` once all steps have been performed.
    fn is_finished(&self) -> bool {
        self.steps() >= self.total_steps()
    }

    /// Performs an update: steps all worlds and trains the networks.
    ///
    /// # Errors
    ///
    /// [`LearnerError`] if the environment fails or a term of the loss is not finite.
    fn advance(&mut self) -> Result<Progress, LearnerError>;

    /// Returns the time spent in each phase of all updates, except [`Phase::Files`].
    fn costs(&self) -> Costs;

    /// Returns the bytes of a checkpoint. Worlds are stored as the actions of their running episodes.
    ///
    /// # Errors
    ///
    /// [`CheckpointError::Format`] if the content does not form a safetensors file.
    fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError>;

    /// Restores a checkpoint of a run with the same task and settings. The run then continues bit for bit.
    /// After an error the learner is unusable.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if the checkpoint is invalid or does not fit the run.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError>;

    /// Returns the policy without exploration. Its inputs are raw observations, which are not normalised.
    fn policy(&self) -> TrainedNetwork;

    /// Returns the SHA-256 digest of all weights as hexadecimal digits.
    fn weights_sha256(&self) -> String;
}

/// Returns the SHA-256 digest of numbers, in hexadecimal.
pub(crate) fn numbers_sha256<'a>(numbers: impl IntoIterator<Item = &'a [f32]>) -> String {
    let bytes: Vec<u8> = numbers.into_iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    motorium_models::sha256::sha256_hex(&bytes)
}

/// Checks that a term of a loss is finite.
pub(crate) fn check_finite(update: u64, term: &'static str, value: f64) -> Result<(), LearnerError> {
    if value.is_finite() { Ok(()) } else { Err(LearnerError::NotFinite { update, term, value }) }
}

/// Returns the sizes of the layers of a network.
pub(crate) fn layer_sizes(inputs: usize, hidden: &[usize], outputs: usize) -> Vec<usize> {
    core::iter::once(inputs).chain(hidden.iter().copied()).chain([outputs]).collect()
}
