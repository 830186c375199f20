//! Soft actor-critic (SAC).
//!
//! A stochastic policy `a = tanh(u)`, `u ~ N(mu(o), diag(sigma(o)^2))`, maximises the reward and the policy's
//! own entropy; the temperature `alpha` adapts to a target entropy `H`. With two critics, their targets `Q'`,
//! and samples `(o, a, r, o')` from the replay buffer, each gradient step minimises
//!
//! ```text
//! y       = r + discount (min_i Q'_i(o', a') - alpha ln pi(a' | o')),    a' ~ pi(. | o')
//! L_Q     = 1/2 E[(Q_i(o, a) - y)^2]
//! L_pi    = E[alpha ln pi(a | o) - min_i Q_i(o, a)],                     a ~ pi(. | o), for fixed noise
//! L_alpha = -ln alpha E[ln pi(a | o) + H]
//! Q'     <- Q' + polyak (Q - Q')
//! ```
//!
//! The policy without exploration is `tanh(mu(o))` within the bounds of the task's action.
//!
//! Source: Haarnoja, Zhou, Hartikainen and others, *Soft actor-critic algorithms and applications*,
//! arXiv:1812.05905, 2018. Defaults: see [`SacSettings`].

mod squashed;

use motorium_models::networks::Adam;
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
    stack, sum,
};
use crate::task::{Task, TaskError, Terms};
use squashed::squash;

/// Settings of SAC: the table `[algorithms.sac]` of a task.
///
/// Unless stated otherwise, defaults follow Haarnoja and others 2018, table 1 (learning rate 3e-4, buffer of
/// 10^6 steps, minibatch of 256, one gradient step per step, polyak 0.005, discount 0.99, target entropy -1
/// per moving joint).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SacSettings {
    /// Settings of steps, replay and networks. Defaults that differ from the source: 100,000 steps in 4
    /// worlds with 4 gradient steps after each step of all worlds, 1000 random steps, layers of 64 and 64
    /// units instead of 256 and 256, and `tanh` instead of ReLU in the policy.
    #[serde(flatten)]
    pub replay: ReplaySettings,
    /// Target entropy per moving joint, for actions between -1 and 1. Default -1.
    pub entropy: f64,
    /// Initial temperature (weight of the entropy), more than 0. Default 1.
    pub temperature: f64,
}

impl Default for SacSettings {
    fn default() -> Self {
        Self {
            replay: ReplaySettings {
                steps: 100_000,
                worlds: 4,
                horizon: 250,
                warmup: 1000,
                gradients: 4,
                buffer: 1_000_000,
                minibatch: 256,
                n_step: 1,
                discount: 0.99,
                polyak: 0.005,
                rate: 3e-4,
                convolutions: vec![],
                hidden: vec![64, 64],
                checkpoint: 10,
            },
            entropy: -1.0,
            temperature: 1.0,
        }
    }
}

impl SacSettings {
    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let check = Check(Algorithm::Sac);
        self.replay.check(check)?;
        if !self.entropy.is_finite() {
            return Err(check.error("entropy", self.entropy, "a finite number"));
        }
        check.positive([("temperature", self.temperature)])
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
    ) -> Result<OffPolicy<E, Sac>, EnvironmentError> {
        self.check()?;
        let method = |terms: &Terms| Sac::new(terms, &self, run.0);
        OffPolicy::new(task, self.replay.clone(), run, method, build)
    }
}

/// Values measured in a gradient step.
pub(crate) const MEASURES: [&str; 5] = ["critic_loss", "policy_loss", "value", "entropy", "temperature"];

/// The networks and learning rule of SAC.
#[derive(Clone, Debug)]
pub struct Sac {
    bounds: Bounds,
    /// Network whose outputs are the means of an action, then the logarithms of the standard deviations.
    actor: Trained,
    critics: Critics,
    log_temperature: f32,
    adam: Adam,
    target_entropy: f64,
}

/// Gradient of the policy for some samples of a batch.
#[derive(Clone, Debug, Default)]
struct PolicyPart {
    gradient: Vec<f32>,
    loss: f64,
    log_probability: f64,
}

impl Sac {
    fn new(terms: &Terms, settings: &SacSettings, seed: u64) -> Result<Self, TaskError> {
        let bounds = Bounds::new(terms, Algorithm::Sac)?;
        let (inputs, width, hidden) = (terms.inputs(), bounds.width(), &settings.replay.hidden);
        let encoding = settings.replay.encoding(Algorithm::Sac, terms)?;
        Ok(Self {
            actor: Trained::new(&encoding, &layer_sizes(inputs, hidden, 2 * width), 0.01, seed, 0),
            critics: Critics::new(2, &encoding, &layer_sizes(inputs + width, hidden, 1), seed),
            log_temperature: settings.temperature.ln() as f32,
            adam: Adam::new(&[1]),
            target_entropy: settings.entropy * bounds.moving() as f64,
            bounds,
        })
    }

    /// Returns actions and their log probabilities from the outputs of the actor, for given noise.
    fn act(&self, output: &DMatrix<f32>, noise: &DMatrix<f32>) -> (DMatrix<f32>, Vec<f32>) {
        let width = self.bounds.width();
        let mut actions = DMatrix::<f32>::zeros(width, output.ncols());
        let mut logarithms = vec![0.0; output.ncols()];
        for (column, logarithm) in logarithms.iter_mut().enumerate() {
            for row in (0..width).filter(|row| self.bounds.active[*row]) {
                let sample =
                    squash(output[(row, column)], output[(width + row, column)], noise[(row, column)]);
                actions[(row, column)] = sample.action;
                *logarithm += sample.log_probability;
            }
        }
        (actions, logarithms)
    }

    /// Returns the gradient of the policy for some samples of a batch.
    fn policy_part(&self, observations: &DMatrix<f32>, noise: &DMatrix<f32>, count: usize) -> PolicyPart {
        let (width, share) = (self.bounds.width(), 1.0 / count as f32);
        let temperature = self.log_temperature.exp();
        let trace = self.actor.network.forward(observations.clone());
        let output = trace.output();
        let (actions, logarithms) = self.act(output, noise);
        let (values, slopes) = self.critics.action_gradients(&stack(observations, &actions), 2, width);
        let mut by_output = DMatrix::<f32>::zeros(2 * width, output.ncols());
        let mut part = PolicyPart::default();
        for (column, (value, logarithm)) in values.iter().zip(&logarithms).enumerate() {
            for row in (0..width).filter(|row| self.bounds.active[*row]) {
                let sample =
                    squash(output[(row, column)], output[(width + row, column)], noise[(row, column)]);
                let slope = slopes[(row, column)];
                by_output[(row, column)] =
                    share * (temperature * sample.by_mean - slope * sample.action_by_mean);
                by_output[(width + row, column)] =
                    share * (temperature * sample.by_log_deviation - slope * sample.action_by_log_deviation);
            }
            part.loss += f64::from(share * (temperature * logarithm - value));
            part.log_probability += f64::from(share * logarithm);
        }
        part.gradient = self.actor.network.gradients(&trace, by_output);
        part
    }
}

impl Method for Sac {
    fn algorithm(&self) -> Algorithm {
        Algorithm::Sac
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
        let width = self.bounds.width();
        let mut noise = DMatrix::<f32>::zeros(width, observations.ncols());
        for (world, mut column) in noise.column_iter_mut().enumerate() {
            let mut random = exploration.random(world);
            column.iter_mut().for_each(|number| *number = StandardNormal.sample(&mut random));
        }
        let trace = self.actor.network.forward(observations);
        out.copy_from_slice(self.act(trace.output(), &noise).0.as_slice());
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
        let (count, width, settings) = (batch.count(), self.bounds.width(), gradient.settings);
        let temperature = self.log_temperature.exp();
        let noise = gradient.noise(2 * width, count);
        let (now, later) = (noise.rows(0, width).into_owned(), noise.rows(width, width).into_owned());
        let chunks = batch.chunks();
        let critics = map_chunks(gradient.threads, &chunks, |range| {
            let next = columns(&batch.next, range);
            let trace = self.actor.network.forward(next.clone());
            let (actions, logarithms) = self.act(trace.output(), &columns(&later, range));
            let values = self.critics.target_values(&stack(&next, &actions));
            let soft = values.iter().zip(&logarithms).map(|(value, log)| value - temperature * log);
            let targets = batch.targets(range, soft);
            let input = stack(&columns(&batch.observations, range), &columns(&batch.actions, range));
            self.critics.part(&input, &targets, count)
        });
        let critic_loss = critics.iter().map(|part| part.loss).sum();
        let value = critics.iter().map(|part| part.value).sum();
        check_finite(gradient.update, "loss of the critics", critic_loss)?;
        watch.lap(Phase::Gradient);
        self.critics.step(&critics, settings.rate);
        watch.lap(Phase::Optimiser);
        let policies = map_chunks(gradient.threads, &chunks, |range| {
            self.policy_part(&columns(&batch.observations, range), &columns(&now, range), count)
        });
        let policy_loss = policies.iter().map(|part| part.loss).sum();
        let log_probability: f64 = policies.iter().map(|part| part.log_probability).sum();
        check_finite(gradient.update, "loss of the policy", policy_loss)?;
        watch.lap(Phase::Gradient);
        self.actor.step(&sum(policies.into_iter().map(|part| part.gradient)), settings.rate);
        let mut logarithm = [self.log_temperature];
        let slope = [-(log_probability + self.target_entropy) as f32];
        self.adam.step([&mut logarithm[..]], [&slope[..]], settings.rate as f32, 0.0);
        self.log_temperature = logarithm[0];
        check_finite(gradient.update, "temperature", f64::from(self.log_temperature.exp()))?;
        self.critics.track(settings.polyak);
        watch.lap(Phase::Optimiser);
        Ok(vec![critic_loss, policy_loss, value, -log_probability, f64::from(temperature)])
    }

    fn policy(&self) -> TrainedNetwork {
        let mut trained = TrainedNetwork::new(&self.actor.network, self.bounds.head());
        let width = self.bounds.width();
        // the policy without exploration needs no standard deviations
        if let Some((weights, bias)) = trained.layers.last_mut() {
            weights.truncate(weights.len() / 2);
            bias.truncate(width);
        }
        trained
    }

    fn parameters(&self) -> Vec<Vec<f32>> {
        let mut all = self.critics.parameters();
        all.push(self.actor.network.to_vec());
        all.push(vec![self.log_temperature]);
        all
    }

    fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        self.actor.write("actor", writer)?;
        self.critics.write(writer)?;
        writer.numbers("temperature", vec![self.log_temperature]);
        writer.optimiser("temperature.adam_steps", &["temperature"], &self.adam)
    }

    fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        self.actor.read("actor", reader)?;
        self.critics.read(reader)?;
        self.log_temperature = reader.numbers("temperature", 1)?[0];
        self.adam = reader.optimiser("temperature.adam_steps", &[("temperature", 1)])?;
        Ok(())
    }
}
