//! Settings of PPO.

use serde::{Deserialize, Serialize};

use crate::learner::{Algorithm, Check, ConvolutionSettings};
use crate::task::TaskError;

/// Settings of [`Ppo`](super::Ppo): the table `[algorithms.ppo]` of a task.
///
/// Unless stated otherwise, defaults follow CleanRL's `ppo_continuous_action` with several worlds (Huang et
/// al., *The 37 implementation details of proximal policy optimization*, ICLR blog track 2022).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PpoSettings {
    /// Number of steps in all worlds together, at least 1. Default 200,000.
    pub steps: u64,
    /// Number of worlds, at least 1. Default 16.
    pub worlds: usize,
    /// Steps of each world between two updates, at least 1. Default 128, which is 2048 steps with 16 worlds.
    pub horizon: usize,
    /// Number of passes over the steps of an update, at least 1. Default 10.
    pub epochs: usize,
    /// Number of steps per minibatch, at least 2. Default 256.
    pub minibatch: usize,
    /// Learning rate of Adam, more than 0. Default 3e-4.
    pub rate: f64,
    /// `true` lowers the learning rate linearly to 0 over the run. As in CleanRL, an update uses the rate at
    /// the first step of its horizon; Stable-Baselines3 uses the rate at the last step. Default true.
    pub anneal: bool,
    /// Target divergence between the policy before and after an update, more than 0. If the divergence
    /// exceeds twice the target, the learning rate is divided by 1.5. If the divergence is below half the
    /// target, the learning rate is multiplied by 1.5 (as in rsl_rl). This adaptation replaces `anneal`.
    /// Default: no adaptation.
    pub target_kl: Option<f64>,
    /// Discount factor per step, more than 0, less than 1. Default 0.99.
    pub discount: f64,
    /// Decay factor of the generalised advantage estimate, 0 to 1. Default 0.95.
    pub lambda: f64,
    /// Limit of the change of the probability ratio, more than 0. Default 0.2.
    pub clip: f64,
    /// Weight of the entropy bonus, at least 0. Default 0.
    pub entropy: f64,
    /// Weight of the squared value error, more than 0. Default 0.5.
    pub value: f64,
    /// Maximum norm of a gradient, more than 0. Default 0.5.
    pub gradient: f64,
    /// Convolutions of each image among the observations, before the hidden layers of policy and value.
    /// The images of a history are the channels of one image; ReLU follows each convolution. Default: none,
    /// pixels are inputs of the first hidden layer.
    pub convolutions: Vec<ConvolutionSettings>,
    /// Number of hidden units of each layer of the policy and value networks. Default 64 and 64.
    pub hidden: Vec<usize>,
    /// Number of gated recurrent units before the hidden layers, in each of the policy and value networks.
    /// Default 0. Must be 0 with `convolutions`.
    pub recurrent: usize,
    /// Number of consecutive steps through which the gradient of recurrent units is propagated, at least 1.
    /// Must divide `horizon` and must not exceed `minibatch`. Default 16.
    pub sequence: usize,
    /// Initial standard deviation of the action, more than 0. Default 1.
    pub deviation: f64,
    /// `true` learns from every step and its mirror image (Mittal and others, ICRA 2024). Requires a task
    /// with a `symmetry` and no recurrent units. Default false.
    pub mirror: bool,
    /// Number of updates between two checkpoints, at least 1. Default 10.
    pub checkpoint: u64,
}

impl Default for PpoSettings {
    fn default() -> Self {
        Self {
            steps: 200_000,
            worlds: 16,
            horizon: 128,
            epochs: 10,
            minibatch: 256,
            rate: 3e-4,
            anneal: true,
            target_kl: None,
            discount: 0.99,
            lambda: 0.95,
            clip: 0.2,
            entropy: 0.0,
            value: 0.5,
            gradient: 0.5,
            convolutions: vec![],
            hidden: vec![64, 64],
            recurrent: 0,
            sequence: 16,
            deviation: 1.0,
            mirror: false,
            checkpoint: 10,
        }
    }
}

impl PpoSettings {
    /// Reads the settings from the table `algorithms` of a task. Missing keys have their defaults.
    ///
    /// # Errors
    ///
    /// [`TaskError`] with the key of an invalid setting.
    pub fn from_table(algorithms: &toml::Table) -> Result<Self, TaskError> {
        let settings: Self = match algorithms.get("ppo") {
            None => Self::default(),
            Some(table) => table
                .clone()
                .try_into()
                .map_err(|error: toml::de::Error| TaskError::Parse(format!("`algorithms.ppo`: {error}")))?,
        };
        settings.check()?;
        Ok(settings)
    }

    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let check = Check(Algorithm::Ppo);
        check.counts([
            ("steps", self.steps),
            ("worlds", self.worlds as u64),
            ("horizon", self.horizon as u64),
            ("epochs", self.epochs as u64),
            ("sequence", self.sequence as u64),
            ("checkpoint", self.checkpoint),
        ])?;
        if self.minibatch < 2 {
            return Err(check.error("minibatch", self.minibatch as f64, "at least 2"));
        }
        if self.recurrent > 0 && !self.horizon.is_multiple_of(self.sequence) {
            let expected = format!("a divisor of `horizon` = {}", self.horizon);
            return Err(check.error("sequence", self.sequence as f64, &expected));
        }
        if self.recurrent > 0 && self.minibatch < self.sequence {
            let expected = format!("at least `sequence` = {}", self.sequence);
            return Err(check.error("minibatch", self.minibatch as f64, &expected));
        }
        if self.mirror && self.recurrent > 0 {
            return Err(check.error("recurrent", self.recurrent as f64, "0 with `mirror`"));
        }
        if self.recurrent > 0 && !self.convolutions.is_empty() {
            return Err(check.error("recurrent", self.recurrent as f64, "0 with `convolutions`"));
        }
        check.positive([
            ("rate", self.rate),
            ("clip", self.clip),
            ("value", self.value),
            ("gradient", self.gradient),
            ("deviation", self.deviation),
            ("target_kl", self.target_kl.unwrap_or(1.0)),
        ])?;
        check.shares([("lambda", self.lambda)])?;
        check.not_negative([("entropy", self.entropy)])?;
        check.network(self.discount, &self.convolutions, &self.hidden)
    }

    /// Returns the number of consecutive steps through which a gradient is propagated; 1 without recurrent
    /// units.
    pub(super) fn unroll(&self) -> usize {
        if self.recurrent > 0 { self.sequence } else { 1 }
    }
}
