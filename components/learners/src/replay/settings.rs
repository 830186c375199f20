//! Settings that off-policy learners share.

use serde::{Deserialize, Serialize};

use crate::learner::Check;
use crate::task::TaskError;

/// Settings of steps, replay and networks, keys of the table of an off-policy algorithm. Defaults and their
/// sources: the settings of each algorithm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplaySettings {
    /// Steps of all worlds together, from 1.
    pub steps: u64,
    /// Worlds, from 1.
    pub worlds: usize,
    /// Steps of each world in an update, a line of the progress, from 1.
    pub horizon: usize,
    /// Steps of all worlds with random actions before the first gradient.
    pub warmup: u64,
    /// Gradients after each step of all worlds, from 1.
    pub gradients: usize,
    /// Steps in the replay buffer, from 1; rounded up to whole steps of all worlds.
    pub buffer: usize,
    /// Steps in a gradient, from 1.
    pub minibatch: usize,
    /// Rewards in a return before the value that follows, from 1.
    pub n_step: usize,
    /// Discount of a step, above 0, below 1.
    pub discount: f64,
    /// Fraction of the networks in their targets after each gradient, above 0, at most 1.
    pub polyak: f64,
    /// Learning rate of Adam, above 0.
    pub rate: f64,
    /// Hidden units of each layer.
    pub hidden: Vec<usize>,
    /// Updates between two checkpoints, from 1.
    pub checkpoint: u64,
}

impl ReplaySettings {
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
        check.network(self.discount, &self.hidden)
    }
}
