//! REINFORCE with a baseline.
//!
//! A stochastic policy `a ~ N(mu(o), diag(sigma^2))` learns from whole episodes. Each update uses one episode
//! of each world. With the returns `G` of an episode and a value function `V(o)` as the baseline, one
//! gradient step over all samples minimises
//!
//! ```text
//! L   = -E[A ln pi(a | o)] + value / 2 E[(V - G)^2] - entropy H
//! G_t = sum_(k >= t) discount^(k - t) reward_k
//! A_t = G_t - V(o_t), with mean 0 and deviation 1 in an update
//! ```
//!
//! A return ends with its episode, even if the episode is truncated, because the value function is only a
//! baseline. A world whose episode has ended waits for the other worlds. The implementation is
//! [PPO](crate::ppo) with one pass and no clipping; observations and rewards are normalised as in PPO.
//!
//! Sources: Williams, *Simple statistical gradient-following algorithms for connectionist reinforcement
//! learning*, Machine Learning 8, 1992; Sutton, Barto, *Reinforcement learning*, 2nd edition, 2018, section
//! 13.4; defaults: [`ReinforceSettings`].

use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{Algorithm, Check, ConvolutionSettings};
use crate::ppo::{Ppo, PpoSettings, Variant};
use crate::task::{Task, TaskError};

/// Settings of REINFORCE: the table `[algorithms.reinforce]` of a task.
///
/// The default learning rate is PyRoboLearn's. The other defaults are PPO's, so that the two algorithms can
/// be compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReinforceSettings {
    /// Number of steps in all worlds together, at least 1. The last update may exceed this number. Default
    /// 200,000.
    pub steps: u64,
    /// Number of worlds and of episodes per update, at least 1. Default 16.
    pub worlds: usize,
    /// Learning rate of Adam, more than 0. Default 1e-3.
    pub rate: f64,
    /// `true` lowers the learning rate linearly to 0 over the run. Default false.
    pub anneal: bool,
    /// Discount factor per step, more than 0, less than 1. Default 0.99.
    pub discount: f64,
    /// Weight of the entropy bonus, at least 0. Default 0.
    pub entropy: f64,
    /// Weight of the squared baseline error, more than 0. Default 0.5.
    pub value: f64,
    /// Maximum norm of a gradient, more than 0. Default 0.5.
    pub gradient: f64,
    /// Convolutions of each image among the observations, before the hidden layers of policy and baseline.
    /// The images of a history are the channels of one image; ReLU follows each convolution. Default: none,
    /// pixels are inputs of the first hidden layer.
    pub convolutions: Vec<ConvolutionSettings>,
    /// Number of hidden units of each layer of the policy and baseline networks. Default 64 and 64.
    pub hidden: Vec<usize>,
    /// Initial standard deviation of the action, more than 0. Default 1.
    pub deviation: f64,
    /// Number of updates between two checkpoints, at least 1. Default 10.
    pub checkpoint: u64,
}

impl Default for ReinforceSettings {
    fn default() -> Self {
        Self {
            steps: 200_000,
            worlds: 16,
            rate: 1e-3,
            anneal: false,
            discount: 0.99,
            entropy: 0.0,
            value: 0.5,
            gradient: 0.5,
            convolutions: vec![],
            hidden: vec![64, 64],
            deviation: 1.0,
            checkpoint: 10,
        }
    }
}

impl ReinforceSettings {
    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let check = Check(Algorithm::Reinforce);
        check.counts([
            ("steps", self.steps),
            ("worlds", self.worlds as u64),
            ("checkpoint", self.checkpoint),
        ])?;
        check.positive([
            ("rate", self.rate),
            ("value", self.value),
            ("gradient", self.gradient),
            ("deviation", self.deviation),
        ])?;
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
        let variant = Variant { algorithm: Algorithm::Reinforce, is_normalised: true, uses_episodes: true };
        let settings = PpoSettings {
            steps: self.steps,
            worlds: self.worlds,
            // replaced by the longest episode of the task
            horizon: 1,
            epochs: 1,
            minibatch: usize::MAX,
            rate: self.rate,
            anneal: self.anneal,
            target_kl: None,
            discount: self.discount,
            lambda: 1.0,
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
