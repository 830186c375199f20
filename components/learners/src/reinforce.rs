//! REINFORCE with a baseline.
//!
//! A stochastic policy `a ~ N(mu(o), diag(sigma^2))` learns from whole episodes, one of each world in an
//! update. With the returns `G` of an episode and a value `V(o)` as the baseline, one gradient over all steps
//! minimises
//!
//! ```text
//! L   = -E[A ln pi(a | o)] + value / 2 E[(V - G)^2] - entropy H
//! G_t = sum_(k >= t) discount^(k - t) reward_k
//! A_t = G_t - V(o_t), with mean 0 and deviation 1 in an update
//! ```
//!
//! Returns end with the episode, truncated or not: the value is a baseline alone. A world whose episode ends
//! before the others' waits for them. The code is [PPO](crate::ppo)'s with one pass and no clip; observations
//! and rewards are normalised as there.
//!
//! Sources: Williams, *Simple statistical gradient-following algorithms for connectionist reinforcement
//! learning*, Machine Learning 8, 1992; Sutton, Barto, *Reinforcement learning*, 2nd edition, 2018, section
//! 13.4; defaults: [`ReinforceSettings`].

use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{Algorithm, Check};
use crate::ppo::{Ppo, PpoSettings, Variant};
use crate::task::{Task, TaskError};

/// Settings of REINFORCE: the table `[algorithms.reinforce]` of a task.
///
/// The rate is PyRoboLearn's; the other defaults are PPO's, so that both compare.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReinforceSettings {
    /// Steps of all worlds together, from 1; the last update may exceed them. Default 200,000.
    pub steps: u64,
    /// Worlds, and episodes in an update, from 1. Default 16.
    pub worlds: usize,
    /// Learning rate of Adam, above 0. Default 1e-3.
    pub rate: f64,
    /// True to lower the learning rate linearly to 0 over the steps. Default false.
    pub anneal: bool,
    /// Discount of a step, above 0, below 1. Default 0.99.
    pub discount: f64,
    /// Weight of the entropy, which is maximised, from 0. Default 0.
    pub entropy: f64,
    /// Weight of the squared error of the baseline, above 0. Default 0.5.
    pub value: f64,
    /// Largest norm of a gradient, above 0. Default 0.5.
    pub gradient: f64,
    /// Hidden units of each layer of policy and baseline. Default 64 and 64.
    pub hidden: Vec<usize>,
    /// Initial standard deviation of the action, above 0. Default 1.
    pub deviation: f64,
    /// Updates between two checkpoints, from 1. Default 10.
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
    /// [`TaskError::Value`].
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
        check.network(self.discount, &self.hidden)
    }

    /// A run before its first step; `build` makes the simulation of a world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`].
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
            // the longest episode of the task
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
