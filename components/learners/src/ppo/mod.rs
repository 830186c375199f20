//! Proximal policy optimisation.
//!
//! A stochastic policy `a ~ N(mu(o), diag(sigma^2))` and a value `V(o)` learn from batches of steps. With the
//! probability ratio `r = pi(a | o) / pi_old(a | o)`, advantages `A` and returns `R`, an update minimises
//!
//! ```text
//! L   = -E[min(r A, clip(r, 1 - c, 1 + c) A)] + value / 2 E[(V - R)^2] - entropy H
//! A_t = sum_k (discount lambda)^k d_(t+k),   d_t = reward_t + discount V(o_(t+1)) - V(o_t),   R_t = A_t + V(o_t)
//! ```
//!
//! A terminated episode has no value after its end; a truncated one has the value of its final observation.
//! Observations are normalised by their running mean and deviation, rewards by the running deviation of the
//! discounted return. Advantages are normalised in each minibatch.
//!
//! Training repeats to the bit: random numbers are counter-based, and the sums of a gradient run over fixed
//! chunks of samples whatever the number of threads.
//!
//! Sources: Schulman, Wolski, Dhariwal, Radford, Klimov, *Proximal policy optimization algorithms*,
//! arXiv:1707.06347, 2017; Schulman, Moritz, Levine, Jordan, Abbeel, *High-dimensional continuous control
//! using generalized advantage estimation*, ICLR 2016; defaults: [`PpoSettings`].

mod checkpoint;
mod normaliser;
mod rollout;
mod run;
mod settings;
mod update;

use std::collections::VecDeque;

use motorium_models::networks::{Adam, Perceptron};
use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

pub use checkpoint::CheckpointError;
pub use normaliser::Normaliser;
use rollout::Rollout;
pub use run::{Run, RunError, Summary};
pub use settings::PpoSettings;

use crate::environment::{EnvironmentError, VectorEnvironment};
use crate::random::{Counter, Purpose};
use crate::task::Task;

/// Episodes over which the return of a training run is averaged.
const RECENT: usize = 100;

/// The errors of training.
#[derive(Debug, thiserror::Error)]
pub enum PpoError {
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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
    /// Loss of the policy, squared error of the value, and entropy of the policy, averaged over the update.
    pub policy_loss: f64,
    /// See `policy_loss`.
    pub value_loss: f64,
    /// See `policy_loss`.
    pub entropy: f64,
    /// Divergence between the policies before and after the update.
    pub divergence: f64,
    /// Learning rate of the update.
    pub rate: f64,
}

/// Numbers of a training run besides its networks and worlds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    seed: u64,
    updates: u64,
    steps: u64,
    episodes: u64,
    rate: f64,
    observations: Normaliser,
    returns: Normaliser,
    /// Discounted and plain return of the running episode of each world, and its length.
    running: Vec<(f64, f64, u64)>,
    /// Return and length of the last episodes.
    recent: VecDeque<(f64, u64)>,
}

/// A training run: worlds, networks, optimiser and counters.
pub struct Ppo<E> {
    settings: PpoSettings,
    threads: usize,
    worlds: VectorEnvironment<E>,
    policy: Perceptron,
    value: Perceptron,
    /// Logarithms of the standard deviations of the action.
    deviations: Vec<f32>,
    /// Actions that move a joint.
    active: Vec<bool>,
    adam: Adam,
    state: State,
    rollout: Rollout,
}

impl<E: Engine + Send> Ppo<E> {
    /// A run before its first step; `build` makes the simulation of a world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`].
    pub fn new(
        task: &Task,
        settings: PpoSettings,
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        settings.check()?;
        let worlds = VectorEnvironment::new(task, (settings.worlds, threads), seed, build)?;
        let (inputs, actions) = (worlds.terms().inputs(), worlds.terms().actions());
        let active = worlds.terms().active_actions();
        let sizes = |outputs| {
            let hidden = settings.hidden.iter().copied();
            core::iter::once(inputs).chain(hidden).chain([outputs]).collect::<Vec<usize>>()
        };
        let weights = |step| Counter { seed, step, ..Counter::default() }.stream(Purpose::Weights);
        let policy = Perceptron::random(&sizes(actions), 0.01, &mut weights(0));
        let value = Perceptron::random(&sizes(1), 1.0, &mut weights(1));
        let deviations = vec![settings.deviation.ln() as f32; actions];
        let adam = Adam::new(&[policy.parameters(), value.parameters(), actions]);
        let rollout = Rollout::new(settings.horizon, settings.worlds, inputs, actions);
        let state = State {
            seed,
            updates: 0,
            steps: 0,
            episodes: 0,
            rate: settings.rate,
            observations: Normaliser::new(inputs),
            returns: Normaliser::new(1),
            running: vec![(0.0, 0.0, 0); settings.worlds],
            recent: VecDeque::with_capacity(RECENT + 1),
        };
        let threads = threads.max(1);
        Ok(Self { settings, threads, worlds, policy, value, deviations, active, adam, state, rollout })
    }

    /// The settings.
    pub fn settings(&self) -> &PpoSettings {
        &self.settings
    }

    /// Steps of all worlds so far.
    pub fn steps(&self) -> u64 {
        self.state.steps
    }

    /// Updates so far.
    pub fn updates(&self) -> u64 {
        self.state.updates
    }

    /// True once all steps of the settings are made.
    pub fn is_finished(&self) -> bool {
        self.state.steps >= self.settings.steps
    }

    /// Steps all worlds through a horizon and updates the networks.
    ///
    /// # Errors
    ///
    /// [`PpoError`].
    pub fn advance(&mut self) -> Result<Progress, PpoError> {
        self.collect()?;
        let losses = self.update()?;
        self.state.updates += 1;
        let recent = &self.state.recent;
        let mean = |value: &dyn Fn(&(f64, u64)) -> f64| {
            (!recent.is_empty()).then(|| recent.iter().map(value).sum::<f64>() / recent.len() as f64)
        };
        Ok(Progress {
            update: self.state.updates,
            steps: self.state.steps,
            episodes: self.state.episodes,
            mean_return: mean(&|(total, _)| *total),
            mean_length: mean(&|(_, length)| *length as f64),
            policy_loss: losses.policy,
            value_loss: losses.value,
            entropy: losses.entropy,
            divergence: losses.divergence,
            rate: losses.rate,
        })
    }

    /// Layers of the policy on raw observations: the normalisation is part of the first.
    pub fn policy_layers(&self) -> Vec<(Vec<f32>, Vec<f32>)> {
        let mut layers = self.policy.rows();
        self.state.observations.fold(&mut layers[0]);
        layers
    }

    /// SHA-256 of all weights of policy and value and of the deviations, in hexadecimal.
    pub fn weights_sha256(&self) -> String {
        let weights = [&self.policy.to_vec(), &self.value.to_vec(), &self.deviations];
        let bytes: Vec<u8> = weights.into_iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        crate::sha256::sha256_hex(&bytes)
    }
}

#[cfg(test)]
mod tests;
