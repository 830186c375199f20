//! Advantage actor-critic (A2C).
//!
//! A stochastic policy `a ~ N(mu(o), diag(sigma^2))` and a value function `V(o)` learn from short rollouts in
//! all worlds. With advantages `A` and returns `R`, an update takes one gradient step over all samples of the
//! rollouts to minimise
//!
//! ```text
//! L   = -E[A ln pi(a | o)] + value / 2 E[(V - R)^2] - entropy H
//! A_t = sum_k (discount lambda)^k d_(t+k),   R_t = A_t + V(o_t)
//! d_t = reward_t + discount V(o_(t+1)) - V(o_t)
//! ```
//!
//! With `lambda = 1`, a return sums the rewards to the end of the rollout and the value of the final state.
//! The implementation is [PPO](crate::ppo) with one pass, no clipping and unnormalised advantages, because
//! this variant of PPO has the same gradient as A2C (Huang, Kanervisto, Raffin and others, *A2C is a special
//! case of PPO*, arXiv:2205.09123, 2022). Observations and rewards are normalised as in PPO.
//!
//! Source: Mnih, Badia, Mirza and others, *Asynchronous methods for deep reinforcement learning*, ICML 2016,
//! in its synchronous form. Defaults: see [`A2cSettings`].

use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{Algorithm, Check, ConvolutionSettings};
use crate::ppo::{Ppo, PpoSettings, Variant};
use crate::task::{Task, TaskError};

/// Settings of A2C: the table `[algorithms.a2c]` of a task.
///
/// Unless stated otherwise, defaults follow Stable-Baselines3's `A2C` (rollouts of 5 steps, learning rate
/// 7e-4, discount 0.99, lambda 1, value 0.5, entropy 0, gradient 0.5). The optimiser is Adam instead of
/// RMSProp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct A2cSettings {
    /// Number of steps in all worlds together, at least 1. Default 200,000, as for PPO.
    pub steps: u64,
    /// Number of worlds, at least 1. Default 16, as for PPO.
    pub worlds: usize,
    /// Steps of each world between two updates, at least 1. Default 5.
    pub horizon: usize,
    /// Learning rate of Adam, more than 0. Default 7e-4.
    pub rate: f64,
    /// `true` lowers the learning rate linearly to 0 over the run. Default false.
    pub anneal: bool,
    /// Discount factor per step, more than 0, less than 1. Default 0.99.
    pub discount: f64,
    /// Decay factor of the advantage estimate, 0 to 1. Default 1.
    pub lambda: f64,
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
    /// Initial standard deviation of the action, more than 0. Default 1.
    pub deviation: f64,
    /// Number of updates between two checkpoints, at least 1. Default 200.
    pub checkpoint: u64,
}

impl Default for A2cSettings {
    fn default() -> Self {
        Self {
            steps: 200_000,
            worlds: 16,
            horizon: 5,
            rate: 7e-4,
            anneal: false,
            discount: 0.99,
            lambda: 1.0,
            entropy: 0.0,
            value: 0.5,
            gradient: 0.5,
            convolutions: vec![],
            hidden: vec![64, 64],
            deviation: 1.0,
            checkpoint: 200,
        }
    }
}

impl A2cSettings {
    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let check = Check(Algorithm::A2c);
        check.counts([
            ("steps", self.steps),
            ("worlds", self.worlds as u64),
            ("horizon", self.horizon as u64),
            ("checkpoint", self.checkpoint),
        ])?;
        check.positive([
            ("rate", self.rate),
            ("value", self.value),
            ("gradient", self.gradient),
            ("deviation", self.deviation),
        ])?;
        check.shares([("lambda", self.lambda)])?;
        check.not_negative([("entropy", self.entropy)])?;
        check.network(self.discount, &self.convolutions, &self.hidden)
    }

    /// Creates a training run that has not performed any step yet. `run` contains the seed and the number of
    /// threads; `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built.
    pub fn learner<E: Engine + Send>(
        self,
        task: &Task,
        run: (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Ppo<E>, EnvironmentError> {
        self.check()?;
        let variant = Variant { algorithm: Algorithm::A2c, is_normalised: false, uses_episodes: false };
        let settings = PpoSettings {
            steps: self.steps,
            worlds: self.worlds,
            horizon: self.horizon,
            epochs: 1,
            minibatch: usize::MAX,
            rate: self.rate,
            anneal: self.anneal,
            target_kl: None,
            discount: self.discount,
            lambda: self.lambda,
            clip: f64::INFINITY,
            entropy: self.entropy,
            value: self.value,
            gradient: self.gradient,
            convolutions: self.convolutions,
            hidden: self.hidden,
            recurrent: 0,
            sequence: 1,
            deviation: self.deviation,
            mirror: false,
            checkpoint: self.checkpoint,
        };
        Ppo::with_variant(task, settings, variant, run, build)
    }
}
