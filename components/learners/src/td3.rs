//! Twin delayed deep deterministic policy gradient (TD3).
//!
//! A deterministic policy `mu(o)` between -1 and 1 ascends the gradient of the first of two critics. With
//! target networks `mu'` and `Q'`, and samples `(o, a, r, o')` from the replay buffer, each gradient step
//! minimises
//!
//! ```text
//! a'  = clip(mu'(o') + clip(N(0, target_noise^2), -target_clip, target_clip), -1, 1)
//! y   = r + discount min_i Q'_i(o', a')
//! L_Q = 1/2 E[(Q_i(o, a) - y)^2]
//! L   = -E[Q_1(o, mu(o))]            every `delay` gradients; then the targets move by `polyak`
//! ```
//!
//! Exploration adds `N(0, noise^2)` to the actions. [DDPG](crate::ddpg) has one critic, no target noise and
//! no delay.
//!
//! Source: Fujimoto, van Hoof, Meger, *Addressing function approximation error in actor-critic methods*, ICML
//! 2018; for defaults, see [`Td3Settings`].

use motorium_models::networks::Perceptron;
use motorium_physics::{BuildError, Engine, Simulation};
use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{
    Algorithm, Check, CheckpointError, CheckpointReader, CheckpointWriter, LearnerError, Phase, Stopwatch,
    TrainedNetwork, check_finite, layer_sizes, map_chunks,
};
use crate::replay::{
    Batch, Bounds, Critics, Exploration, Gradient, Method, OffPolicy, ReplaySettings, Trained, columns,
    stack, sum, track,
};
use crate::task::{Task, TaskError, Terms};

/// Settings of TD3: the table `[algorithms.td3]` of a task.
///
/// Unless stated otherwise, defaults follow the authors' code (github.com/sfujim/TD3: learning rate 3e-4,
/// minibatch of 256, one gradient step per step, buffer of 10^6 steps, polyak 0.005, discount 0.99, noise
/// levels and delay of the paper).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Td3Settings {
    /// Settings of steps, replay and networks. The defaults are the defaults of
    /// [`SacSettings`](crate::sac::SacSettings), some of which differ from the source.
    #[serde(flatten)]
    pub replay: ReplaySettings,
    /// Standard deviation of the exploration noise, at least 0. Default 0.1.
    pub noise: f64,
    /// Standard deviation of the noise in target actions, at least 0. Default 0.2.
    pub target_noise: f64,
    /// Limit of the noise in target actions, at least 0. Default 0.5.
    pub target_clip: f64,
    /// Number of gradient steps of the critics per gradient step of the policy, at least 1. Default 2.
    pub delay: u64,
}

impl Default for Td3Settings {
    fn default() -> Self {
        let replay = crate::sac::SacSettings::default().replay;
        Self { replay, noise: 0.1, target_noise: 0.2, target_clip: 0.5, delay: 2 }
    }
}

impl Td3Settings {
    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        self.check_for(Check(Algorithm::Td3))
    }

    pub(crate) fn check_for(&self, check: Check) -> Result<(), TaskError> {
        self.replay.check(check)?;
        check.counts([("delay", self.delay)])?;
        check.not_negative([
            ("noise", self.noise),
            ("target_noise", self.target_noise),
            ("target_clip", self.target_clip),
        ])
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
    ) -> Result<OffPolicy<E, Deterministic>, EnvironmentError> {
        self.check()?;
        let method = |terms: &Terms| Deterministic::new(terms, &self, (Algorithm::Td3, 2), run.0);
        OffPolicy::new(task, self.replay.clone(), run, method, build)
    }
}

/// Values measured in a gradient step.
pub(crate) const MEASURES: [&str; 2] = ["critic_loss", "value"];

/// The networks and learning rule of TD3 and DDPG.
#[derive(Clone, Debug)]
pub struct Deterministic {
    algorithm: Algorithm,
    bounds: Bounds,
    actor: Trained,
    target: Perceptron,
    critics: Critics,
    noise: f32,
    target_noise: f32,
    target_clip: f32,
    delay: u64,
}

impl Deterministic {
    /// Creates the learning part of an algorithm with a number of critics.
    pub(crate) fn new(
        terms: &Terms,
        settings: &Td3Settings,
        (algorithm, critics): (Algorithm, usize),
        seed: u64,
    ) -> Result<Self, TaskError> {
        let bounds = Bounds::new(terms, algorithm)?;
        let (inputs, width, hidden) = (terms.inputs(), bounds.width(), &settings.replay.hidden);
        let encoding = settings.replay.encoding(algorithm, terms)?;
        let actor = Trained::new(&encoding, &layer_sizes(inputs, hidden, width), 0.01, seed, 0);
        Ok(Self {
            algorithm,
            target: actor.network.clone(),
            actor,
            critics: Critics::new(critics, &encoding, &layer_sizes(inputs + width, hidden, 1), seed),
            noise: settings.noise as f32,
            target_noise: settings.target_noise as f32,
            target_clip: settings.target_clip as f32,
            delay: settings.delay,
            bounds,
        })
    }

    /// Squashes the outputs of the actor. Numbers that move no joint are 0.
    fn squash(&self, output: &DMatrix<f32>) -> DMatrix<f32> {
        let mut actions = output.map(f32::tanh);
        for (mut row, active) in actions.row_iter_mut().zip(&self.bounds.active) {
            if !active {
                row.fill(0.0);
            }
        }
        actions
    }

    /// Adds noise to actions within their bounds.
    fn disturb(&self, actions: &mut DMatrix<f32>, noise: impl Fn(usize, usize) -> f32) {
        for column in 0..actions.ncols() {
            for row in (0..actions.nrows()).filter(|row| self.bounds.active[*row]) {
                let action = &mut actions[(row, column)];
                *action = (*action + noise(row, column)).clamp(-1.0, 1.0);
            }
        }
    }

    /// Returns the gradient of the policy for some samples of a batch, and their share of the loss.
    fn policy_part(&self, observations: &DMatrix<f32>, count: usize) -> (Vec<f32>, f64) {
        let share = 1.0 / count as f32;
        let trace = self.actor.network.forward(observations.clone());
        let actions = self.squash(trace.output());
        let input = stack(observations, &actions);
        let (values, mut slopes) = self.critics.action_gradients(&input, 1, self.bounds.width());
        for (slope, action) in slopes.iter_mut().zip(actions.iter()) {
            *slope *= -share * (1.0 - action * action);
        }
        for (mut row, active) in slopes.row_iter_mut().zip(&self.bounds.active) {
            if !active {
                row.fill(0.0);
            }
        }
        let loss = values.iter().map(|value| f64::from(-share * value)).sum();
        (self.actor.network.gradients(&trace, slopes), loss)
    }
}

impl Method for Deterministic {
    fn algorithm(&self) -> Algorithm {
        self.algorithm
    }

    fn measures(&self) -> &'static [&'static str] {
        &MEASURES
    }

    fn width(&self) -> usize {
        self.bounds.width()
    }

    fn act_randomly(&self, exploration: Exploration, out: &mut [f32]) {
        self.bounds.act_randomly(exploration, out);
    }

    fn explore(&self, observations: DMatrix<f32>, exploration: Exploration, out: &mut [f32]) {
        let mut actions = self.squash(self.actor.network.forward(observations).output());
        let mut noise = DMatrix::<f32>::zeros(actions.nrows(), actions.ncols());
        for (world, mut column) in noise.column_iter_mut().enumerate() {
            let mut random = exploration.random(world);
            column.iter_mut().for_each(|number| *number = StandardNormal.sample(&mut random));
        }
        self.disturb(&mut actions, |row, column| self.noise * noise[(row, column)]);
        out.copy_from_slice(actions.as_slice());
    }

    fn command(&self, stored: &[f32], action: &mut [f32]) {
        self.bounds.command(stored, action);
    }

    fn learn(
        &mut self,
        batch: &Batch,
        gradient: Gradient<'_>,
        watch: &mut Stopwatch,
    ) -> Result<Vec<f64>, LearnerError> {
        let (count, settings, chunks) = (batch.count(), gradient.settings, batch.chunks());
        let noise = gradient.noise(self.bounds.width(), count);
        let critics = map_chunks(gradient.threads, &chunks, |range| {
            let next = columns(&batch.next, range);
            let mut actions = self.squash(self.target.forward(next.clone()).output());
            self.disturb(&mut actions, |row, column| {
                let disturbance = self.target_noise * noise[(row, range.start + column)];
                disturbance.clamp(-self.target_clip, self.target_clip)
            });
            let values = self.critics.target_values(&stack(&next, &actions));
            let targets = batch.targets(range, values);
            let input = stack(&columns(&batch.observations, range), &columns(&batch.actions, range));
            self.critics.part(&input, &targets, count)
        });
        let critic_loss = critics.iter().map(|part| part.loss).sum();
        let value = critics.iter().map(|part| part.value).sum();
        check_finite(gradient.update, "loss of the critics", critic_loss)?;
        watch.lap(Phase::Gradient);
        self.critics.step(&critics, settings.rate);
        watch.lap(Phase::Optimiser);
        if (gradient.number + 1).is_multiple_of(self.delay) {
            let policies = map_chunks(gradient.threads, &chunks, |range| {
                self.policy_part(&columns(&batch.observations, range), count)
            });
            let policy_loss = policies.iter().map(|(_, loss)| loss).sum();
            check_finite(gradient.update, "loss of the policy", policy_loss)?;
            watch.lap(Phase::Gradient);
            self.actor.step(&sum(policies.into_iter().map(|(gradient, _)| gradient)), settings.rate);
            self.critics.track(settings.polyak);
            track(&mut self.target, &self.actor.network, settings.polyak as f32);
            watch.lap(Phase::Optimiser);
        }
        Ok(vec![critic_loss, value])
    }

    fn policy(&self) -> TrainedNetwork {
        TrainedNetwork::new(&self.actor.network, self.bounds.head())
    }

    fn parameters(&self) -> Vec<Vec<f32>> {
        let mut all = self.critics.parameters();
        all.extend([self.actor.network.to_vec(), self.target.to_vec()]);
        all
    }

    fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        self.actor.write("actor", writer)?;
        writer.numbers("actor.target", self.target.to_vec());
        self.critics.write(writer)
    }

    fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        self.actor.read("actor", reader)?;
        reader.network("actor.target", &mut self.target)?;
        self.critics.read(reader)
    }
}
