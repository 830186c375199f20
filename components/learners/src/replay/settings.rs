//! Shared settings of off-policy learners.

use serde::{Deserialize, Serialize};

use crate::learner::{Algorithm, Check, ConvolutionSettings, Encoding};
use crate::task::{TaskError, Terms};

/// Settings of steps, replay and networks, as keys in the table of an off-policy algorithm. For defaults and
/// their sources, see the settings of each algorithm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplaySettings {
    /// Number of steps in all worlds together, at least 1.
    pub steps: u64,
    /// Number of worlds, at least 1.
    pub worlds: usize,
    /// Steps of each world per update, at least 1. Each update writes one line of the progress file.
    pub horizon: usize,
    /// Number of steps with random actions before the first gradient step, in all worlds together.
    pub warmup: u64,
    /// Number of gradient steps after each step of all worlds, at least 1.
    pub gradients: usize,
    /// Capacity of the replay buffer in steps, at least 1. Rounded up to whole steps of all worlds.
    pub buffer: usize,
    /// Number of samples per minibatch, at least 1.
    pub minibatch: usize,
    /// Number of rewards in a return before the bootstrapped value, at least 1.
    pub n_step: usize,
    /// Discount factor per step, more than 0, less than 1.
    pub discount: f64,
    /// Fraction by which the target networks move towards the trained networks after each gradient step, more
    /// than 0, at most 1.
    pub polyak: f64,
    /// Learning rate of Adam, more than 0.
    pub rate: f64,
    /// Convolutions of each image among the observations, before the hidden layers of all networks.
    /// The images of a history are the channels of one image; ReLU follows each convolution. Default: none,
    /// pixels are inputs of the first hidden layer.
    pub convolutions: Vec<ConvolutionSettings>,
    /// Number of hidden units of each layer.
    pub hidden: Vec<usize>,
    /// Number of updates between two checkpoints, at least 1.
    pub checkpoint: u64,
}

impl ReplaySettings {
    /// Returns the convolutions of the images that a task observes.
    pub(crate) fn encoding(&self, algorithm: Algorithm, terms: &Terms) -> Result<Encoding, TaskError> {
        Encoding::new(algorithm.name(), &self.convolutions, terms.policy())
    }

    /// Checks all settings.
    pub(crate) fn check(&self, check: Check) -> Result<(), TaskError> {
        check.counts([
            ("steps", self.steps),
            ("worlds", self.worlds as u64),
            ("horizon", self.horizon as u64),
            ("gradients", self.gradients as u64),
            ("buffer", self.buffer as u64),
            ("minibatch", self.minibatch as u64),
            ("n_step", self.n_step as u64),
            ("checkpoint", self.checkpoint),
        ])?;
        check.positive([("rate", self.rate), ("polyak", self.polyak)])?;
        check.shares([("polyak", self.polyak)])?;
        check.network(self.discount, &self.convolutions, &self.hidden)
    }
}
