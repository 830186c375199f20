//! Settings of imitation.

use serde::{Deserialize, Serialize};

use crate::learner::{ConvolutionSettings, check_convolutions};
use crate::task::TaskError;

/// Settings of [`Imitation`](super::Imitation): the table `[algorithms.dagger]` of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImitationSettings {
    /// Number of iterations, at least 1. Default 10. Behaviour cloning runs a single iteration.
    pub iterations: u64,
    /// Number of steps in an iteration, in all worlds together, at least 1. Default 2000.
    pub steps: u64,
    /// Number of worlds, at least 1. Default 8.
    pub worlds: usize,
    /// Probability that the expert acts in the first iteration, 0 to 1. Default 1.
    pub beta: f64,
    /// Factor applied to the probability `beta` after each iteration, 0 to 1. Default 0.5 (Ross and others).
    pub decay: f64,
    /// Number of passes over all labels after an iteration, at least 1. Default 50.
    pub epochs: usize,
    /// Number of labels per minibatch, at least 1. Default 128.
    pub minibatch: usize,
    /// Learning rate of Adam, more than 0. Default 1e-3.
    pub rate: f64,
    /// `true` lowers the learning rate linearly to 0 over the passes of an iteration. Default false.
    pub anneal: bool,
    /// Convolutions of each image among the observations, before the hidden layers of the network.
    /// The images of a history are the channels of one image; ReLU follows each convolution. Default: none,
    /// pixels are inputs of the first hidden layer.
    pub convolutions: Vec<ConvolutionSettings>,
    /// Number of hidden units of each layer; an empty list means a linear policy. Default 64 and 64.
    pub hidden: Vec<usize>,
}

impl Default for ImitationSettings {
    fn default() -> Self {
        Self {
            iterations: 10,
            steps: 2000,
            worlds: 8,
            beta: 1.0,
            decay: 0.5,
            epochs: 50,
            minibatch: 128,
            rate: 1e-3,
            anneal: false,
            convolutions: vec![],
            hidden: vec![64, 64],
        }
    }
}

impl ImitationSettings {
    /// Reads the settings from the table `algorithms` of a task. Missing keys have their defaults.
    ///
    /// # Errors
    ///
    /// [`TaskError`] with the key of an invalid setting.
    pub fn from_table(algorithms: &toml::Table) -> Result<Self, TaskError> {
        let settings: Self = match algorithms.get("dagger") {
            None => Self::default(),
            Some(table) => table.clone().try_into().map_err(|error: toml::de::Error| {
                TaskError::Parse(format!("`algorithms.dagger`: {error}"))
            })?,
        };
        settings.check()?;
        Ok(settings)
    }

    /// Returns the learning rate in a pass over the labels, counted from 0.
    pub(super) fn rate_in(&self, epoch: u64) -> f64 {
        if self.anneal { self.rate * (1.0 - epoch as f64 / self.epochs as f64) } else { self.rate }
    }

    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let value = |key: &str, found: f64, expected: &str| TaskError::Value {
            key: format!("algorithms.dagger.{key}"),
            found: found.to_string(),
            expected: expected.to_owned(),
        };
        for (key, count) in [
            ("iterations", self.iterations as usize),
            ("steps", self.steps as usize),
            ("worlds", self.worlds),
            ("epochs", self.epochs),
            ("minibatch", self.minibatch),
        ] {
            if count == 0 {
                return Err(value(key, 0.0, "at least 1"));
            }
        }
        for (key, share) in [("beta", self.beta), ("decay", self.decay)] {
            if !(0.0..=1.0).contains(&share) {
                return Err(value(key, share, "0 to 1"));
            }
        }
        if !(self.rate > 0.0 && self.rate.is_finite()) {
            return Err(value("rate", self.rate, "above 0"));
        }
        check_convolutions("dagger", &self.convolutions)?;
        if self.hidden.contains(&0) {
            return Err(value("hidden", 0.0, "at least one unit in each layer"));
        }
        Ok(())
    }
}
