//! Proximal policy optimisation.
//!
//! A stochastic policy `a ~ N(mu(o), diag(sigma^2))` and a value `V(o)` learn from batches of steps. The
//! policy of a task with [choices](crate::task::Choices) is `a ~ softmax(mu(o))`, with one output per choice.
//! With the probability ratio `r = pi(a | o) / pi_old(a | o)`, advantages `A` and returns `R`, an update
//! minimises
//!
//! ```text
//! L   = -E[min(r A, clip(r, 1 - c, 1 + c) A)] + value / 2 E[(V - R)^2] - entropy H
//! A_t = sum_k (discount lambda)^k d_(t+k),   d_t = reward_t + discount V(o_(t+1)) - V(o_t)
//! R_t = A_t + V(o_t)
//! ```
//!
//! The value after a terminated episode is 0; after a truncated episode it is the value of the final
//! observation. Observations are normalised by their running mean and standard deviation, rewards by the
//! running standard deviation of the discounted return. Both statistics are updated in every step, as in
//! Stable-Baselines3. Advantages are normalised in each minibatch.
//!
//! With [`PpoSettings::recurrent`], policy and value each have gated recurrent units (GRU) before their
//! layers. The states of these units are reset at the start of each episode. A minibatch then consists of
//! whole sequences of consecutive steps. Each sequence starts from the state stored during the rollout, and
//! the gradient is propagated back through its steps, but not across the end of an episode.
//!
//! With [`PpoSettings::mirror`], the mirror image of each step is a further sample, with the probability,
//! advantage and return of the step. The observation statistics include the steps and their mirror images.
//!
//! Training is bit-for-bit reproducible: random numbers are counter-based, and gradients are summed over
//! fixed chunks of samples, independent of the number of threads.
//!
//! Sources: Schulman, Wolski, Dhariwal, Radford, Klimov, *Proximal policy optimization algorithms*,
//! arXiv:1707.06347, 2017; Schulman, Moritz, Levine, Jordan, Abbeel, *High-dimensional continuous control
//! using generalized advantage estimation*, ICLR 2016; Cho and others, *Learning phrase representations using
//! RNN encoder-decoder*, EMNLP 2014 (GRU); Ni, Eysenbach, Salakhutdinov, *Recurrent model-free RL can be a
//! strong baseline for many POMDPs*, ICML 2022 (separate memories); defaults: [`PpoSettings`].

mod checkpoint;
mod collect;
mod distribution;
mod network;
mod part;
mod rollout;
mod settings;
mod update;

use motorium_models::networks::{Adam, Perceptron};
use motorium_physics::{BuildError, Engine, Simulation};
use serde::{Deserialize, Serialize};

use distribution::Distribution;
use network::Network;
use part::{Part, Passes};
use rollout::{Rollout, Spread};
pub use settings::PpoSettings;

use crate::environment::{EnvironmentError, VectorEnvironment};
pub use crate::learner::Normaliser;
use crate::learner::{
    Algorithm, Check, CheckpointError, Costs, Encoding, Episodes, Head, Learner, LearnerError, Progress,
    Stopwatch, TrainedNetwork, numbers_sha256,
};
use crate::random::{Counter, Purpose};
use crate::task::{Choices, Mirror, Task, TaskError};

/// Values measured in an update, in the order of [`Progress::values`].
pub(crate) const MEASURES: [&str; 5] = ["policy_loss", "value_loss", "entropy", "divergence", "rate"];

/// Added by Adam to the root of the second moment: 1e-5 as in CleanRL's `ppo_continuous_action` and
/// Stable-Baselines3, not Adam's 1e-8.
const EPSILON: f32 = 1e-5;

/// Differences between on-policy methods.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Variant {
    /// The algorithm.
    pub(crate) algorithm: Algorithm,
    /// Normalises advantages to mean 0 and standard deviation 1 in each gradient step.
    pub(crate) is_normalised: bool,
    /// An update uses one whole episode per world instead of a horizon, and no value after its end.
    pub(crate) uses_episodes: bool,
}

/// State of a training run besides its networks and worlds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    seed: u64,
    updates: u64,
    steps: u64,
    rate: f64,
    observations: Normaliser,
    returns: Normaliser,
    /// Discounted return of the running episode of each world.
    discounted: Vec<f64>,
    episodes: Episodes,
}

/// A training run of PPO: worlds, networks, optimiser and counters. [A2C](crate::a2c) and
/// [REINFORCE](crate::reinforce) are variants of PPO.
pub struct Ppo<E> {
    settings: PpoSettings,
    variant: Variant,
    worlds: VectorEnvironment<E>,
    policy: Network,
    value: Network,
    /// Recurrent states of policy and value, world after world; empty without a memory.
    memories: [Vec<f32>; 2],
    /// Choices of a discrete task, whose actions are stored by their number.
    choices: Option<Choices>,
    /// Logarithms of the standard deviations of the action; empty for choices.
    deviations: Vec<f32>,
    /// Numbers of the action that have an effect; empty for choices.
    active: Vec<bool>,
    /// Mirror of the steps, if images are used.
    mirror: Option<Mirror>,
    /// The mirror image of each choice, if images are used.
    mirrored_choices: Vec<usize>,
    adam: Adam,
    state: State,
    rollout: Rollout,
    /// Buffers for the gradients of chunks and for the passes of threads.
    memory: (Vec<Part>, Vec<Passes>),
    watch: Stopwatch,
}

impl<E: Engine + Send> Ppo<E> {
    /// Creates a training run that has not performed any step yet. `run` contains the seed and the number of
    /// threads; `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built.
    pub fn new(
        task: &Task,
        settings: PpoSettings,
        run: (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        settings.check()?;
        let variant = Variant { algorithm: Algorithm::Ppo, is_normalised: true, uses_episodes: false };
        Self::with_variant(task, settings, variant, run, build)
    }

    /// Creates a run of an on-policy method with checked settings.
    pub(crate) fn with_variant(
        task: &Task,
        mut settings: PpoSettings,
        variant: Variant,
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        let worlds = VectorEnvironment::new(task, (settings.worlds, threads), seed, build)?;
        let inputs = worlds.terms().inputs();
        let choices = worlds.terms().choices().cloned();
        if choices.is_some() {
            check_discrete(task, variant.algorithm)?;
        }
        if variant.uses_episodes {
            settings.horizon = worlds.terms().steps();
        }
        let mirror = worlds.terms().mirror().filter(|_| settings.mirror).cloned();
        if settings.mirror && mirror.is_none() {
            return Err(TaskError::value("symmetry", "none", "the symmetry that `mirror` needs").into());
        }
        let mirrored_choices = match (&mirror, &choices) {
            (Some(mirror), Some(choices)) => mirror.choices(choices)?,
            _ => Vec::new(),
        };
        let active = if choices.is_some() { vec![] } else { worlds.terms().active_actions() };
        let outputs = choices.as_ref().map_or(active.len(), Choices::count);
        let stored = if choices.is_some() { 1 } else { active.len() };
        let weights = |step| Counter { seed, step, ..Counter::default() }.stream(Purpose::Weights);
        let (units, hidden) = (settings.recurrent, &settings.hidden);
        let encoding =
            Encoding::new(variant.algorithm.name(), &settings.convolutions, worlds.terms().policy())?;
        let policy = Network::random(&encoding, (inputs, units, outputs), hidden, 0.01, &mut weights(0));
        let value = Network::random(&encoding, (inputs, units, 1), hidden, 1.0, &mut weights(1));
        let deviations = vec![settings.deviation.ln() as f32; active.len()];
        let adam = Adam::new(&[policy.parameters(), value.parameters(), active.len()]).with_epsilon(EPSILON);
        let rollout = Rollout::new(settings.horizon, settings.worlds, inputs, stored)
            .with_memory(settings.unroll(), units)
            .with_images(settings.mirror);
        let memory = vec![0.0; settings.worlds * units];
        let state = State {
            seed,
            updates: 0,
            steps: 0,
            rate: settings.rate,
            observations: encoding.normaliser(inputs),
            returns: Normaliser::new(1),
            discounted: vec![0.0; settings.worlds],
            episodes: Episodes::new(settings.worlds),
        };
        Ok(Self {
            settings,
            variant,
            worlds,
            policy,
            value,
            memories: [memory.clone(), memory],
            choices,
            deviations,
            active,
            mirror,
            mirrored_choices,
            adam,
            state,
            rollout,
            memory: (vec![], vec![]),
            watch: Stopwatch::start(),
        })
    }

    /// Replaces the initial policy by a trained policy, such as an [imitator](crate::imitation::Imitation).
    /// The network expects observations that are normalised with `observations`.
    ///
    /// # Panics
    ///
    /// If the layers of the network differ from the settings, or the settings have recurrent units.
    pub fn start_from(&mut self, policy: &Perceptron, observations: &Normaliser) {
        assert_eq!(self.settings.recurrent, 0, "recurrent units");
        self.policy.set(&policy.to_vec());
        self.state.observations = observations.clone();
    }

    /// The distribution of actions around the outputs of the policy.
    fn distribution(&self) -> Distribution {
        match self.choices {
            Some(_) => Distribution::Categorical,
            None => Distribution::Normal(Spread::new(&self.deviations, &self.active)),
        }
    }

    /// Returns the settings.
    pub fn settings(&self) -> &PpoSettings {
        &self.settings
    }

    /// Returns the number of steps so far, in all worlds together.
    pub fn steps(&self) -> u64 {
        self.state.steps
    }

    /// Returns the number of updates so far.
    pub fn updates(&self) -> u64 {
        self.state.updates
    }

    /// Returns `true` once all steps have been performed.
    pub fn is_finished(&self) -> bool {
        self.state.steps >= self.settings.steps
    }

    /// Performs an update: steps all worlds through a horizon and trains the networks.
    ///
    /// # Errors
    ///
    /// [`LearnerError`] if the environment fails or a term of the loss is not finite.
    pub fn advance(&mut self) -> Result<Progress, LearnerError> {
        self.watch.skip();
        self.collect()?;
        let losses = self.update()?;
        self.state.updates += 1;
        let State { updates, steps, episodes, .. } = &self.state;
        Ok(Progress {
            update: *updates,
            steps: *steps,
            episodes: episodes.ended,
            mean_return: episodes.mean_return(),
            mean_length: episodes.mean_length(),
            values: vec![losses.policy, losses.value, losses.entropy, losses.divergence, losses.rate],
        })
    }

    /// Returns the SHA-256 digest of the weights of the policy and value networks and of the standard
    /// deviations, as hexadecimal digits.
    pub fn weights_sha256(&self) -> String {
        let weights = [&self.policy.to_vec(), &self.value.to_vec(), &self.deviations];
        numbers_sha256(weights.map(Vec::as_slice))
    }
}

impl<E: Engine + Send> Learner for Ppo<E> {
    fn algorithm(&self) -> Algorithm {
        self.variant.algorithm
    }

    fn measures(&self) -> &'static [&'static str] {
        &MEASURES
    }

    fn steps(&self) -> u64 {
        self.state.steps
    }

    fn total_steps(&self) -> u64 {
        self.settings.steps
    }

    fn updates(&self) -> u64 {
        self.state.updates
    }

    fn checkpoint_interval(&self) -> u64 {
        self.settings.checkpoint
    }

    fn advance(&mut self) -> Result<Progress, LearnerError> {
        self.advance()
    }

    fn costs(&self) -> Costs {
        self.watch.costs()
    }

    fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError> {
        self.checkpoint()
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError> {
        self.restore(bytes)
    }

    fn policy(&self) -> TrainedNetwork {
        let mut trained = self.policy.trained().normalised(&self.state.observations);
        if let Some(choices) = &self.choices {
            trained.head = Head::Choice { table: choices.rows().to_vec() };
        }
        trained
    }

    fn weights_sha256(&self) -> String {
        self.weights_sha256()
    }
}

/// Checks the settings of a task with choices.
fn check_discrete(task: &Task, algorithm: Algorithm) -> Result<(), TaskError> {
    Check(algorithm).absent_with_choices(task, "deviation")
}

#[cfg(test)]
mod tests;
