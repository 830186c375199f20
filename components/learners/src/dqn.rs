//! Deep Q-network (DQN).
//!
//! A network estimates the value `Q(o, c)` of each of a few [choices](crate::task::Choices): the rows of
//! `action.choices`. For a task with continuous actions, the choices are a grid: all combinations of `bins`
//! values per moving joint, evenly spaced between the bounds of the action. With a target network `Q'` and
//! samples `(o, c, r, o')` from the replay buffer, each gradient step minimises
//!
//! ```text
//! y = r + discount Q'(o', argmax_k Q(o', k))       double DQN; else r + discount max_k Q'(o', k)
//! L = E[huber(Q(o, c) - y)],    huber(e) = e^2 / 2 where |e| < 1, else |e| - 1/2
//! ```
//!
//! and moves the target network towards the trained network by the fraction `polyak`. A choice is random with
//! probability `epsilon`, which decreases linearly. The policy without exploration is greedy.
//!
//! Sources: Mnih, Kavukcuoglu, Silver and others, *Human-level control through deep reinforcement learning*,
//! Nature 518, 2015; van Hasselt, Guez, Silver, *Deep reinforcement learning with double Q-learning*, AAAI
//! 2016; for defaults, see [`DqnSettings`].

use motorium_models::networks::Perceptron;
use motorium_physics::{BuildError, Engine, Simulation};
use nalgebra::DMatrix;
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::environment::EnvironmentError;
use crate::learner::{
    Algorithm, Check, CheckpointError, CheckpointReader, CheckpointWriter, Head, LearnerError,
    LinearSchedule, Phase, Stopwatch, TrainedNetwork, check_finite, layer_sizes, map_chunks,
};
use crate::replay::{
    Batch, Bounds, CriticPart, Exploration, Gradient, Method, OffPolicy, ReplaySettings, Trained, columns,
    sum, track,
};
use crate::task::{Choices, Task, TaskError, Terms, best};

/// Settings of DQN: the table `[algorithms.dqn]` of a task.
///
/// Unless stated otherwise, defaults follow CleanRL's `dqn` (learning rate 2.5e-4, minibatch of 128,
/// exploration from 1 to 0.05 over the first half of all steps, discount 0.99).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DqnSettings {
    /// Settings of steps, replay and networks. Defaults that differ from the source: 100,000 steps in 4
    /// worlds with 4 gradient steps after each step of all worlds, 1000 random steps, `tanh` layers of 64 and
    /// 64 units, and targets that move by 0.005 after each gradient step instead of periodic copies.
    #[serde(flatten)]
    pub replay: ReplaySettings,
    /// Number of discrete values per moving joint, for a task with continuous actions, at least 2. Default 3.
    /// The values of all joints may form at most 256 combinations.
    pub bins: usize,
    /// `true` for double DQN: the network selects the action, the target network evaluates it. Default true.
    pub double: bool,
    /// Probability of a random choice after the warm-up, 0 to 1. Default 1.
    pub epsilon: f64,
    /// Final probability of a random choice, 0 to 1. Default 0.05.
    pub final_epsilon: f64,
    /// Fraction of all steps over which the probability decreases, more than 0, at most 1. Default 0.5.
    pub exploration: f64,
}

impl Default for DqnSettings {
    fn default() -> Self {
        let replay = crate::sac::SacSettings::default().replay;
        Self {
            replay: ReplaySettings { rate: 2.5e-4, minibatch: 128, ..replay },
            bins: 3,
            double: true,
            epsilon: 1.0,
            final_epsilon: 0.05,
            exploration: 0.5,
        }
    }
}

impl DqnSettings {
    /// Checks all settings.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] with the key of the first invalid setting.
    pub fn check(&self) -> Result<(), TaskError> {
        let check = Check(Algorithm::Dqn);
        self.replay.check(check)?;
        if self.bins < 2 {
            return Err(check.error("bins", self.bins as f64, "at least 2"));
        }
        check.positive([("exploration", self.exploration)])?;
        check.shares([
            ("epsilon", self.epsilon),
            ("final_epsilon", self.final_epsilon),
            ("exploration", self.exploration),
        ])
    }

    /// Creates a training run that has not performed any step yet. `run` contains the seed and the number of
    /// threads; `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built. A task with continuous actions must have bounds on its action and yield at most 256 choices.
    /// A task with discrete actions must not set `bins`.
    pub fn learner<E: Engine + Send>(
        self,
        task: &Task,
        run: (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<OffPolicy<E, Dqn>, EnvironmentError> {
        self.check()?;
        Check(Algorithm::Dqn).absent_with_choices(task, "bins")?;
        let method = |terms: &Terms| Dqn::new(terms, &self, run.0);
        OffPolicy::new(task, self.replay.clone(), run, method, build)
    }
}

/// The choices of a task with continuous actions.
fn grid(terms: &Terms, bins: usize) -> Result<Choices, TaskError> {
    let bounds = Bounds::new(terms, Algorithm::Dqn)?;
    match Choices::grid(&bounds.active, bins) {
        Some(grid) => Ok(grid.map(|stored, action| bounds.command(stored, action))),
        None => {
            let (most, joints) = (Choices::MOST, bounds.moving());
            let expected = format!("at most {most} combinations of the values of {joints} joints");
            Err(Check(Algorithm::Dqn).error("bins", bins as f64, &expected))
        }
    }
}

/// Values measured in a gradient step.
pub(crate) const MEASURES: [&str; 2] = ["critic_loss", "value"];

/// The network and learning rule of DQN.
#[derive(Clone, Debug)]
pub struct Dqn {
    choices: Choices,
    network: Trained,
    target: Perceptron,
    double: bool,
    epsilon: LinearSchedule,
}

impl Dqn {
    fn new(terms: &Terms, settings: &DqnSettings, seed: u64) -> Result<Self, TaskError> {
        let choices = match terms.choices() {
            Some(choices) => choices.clone(),
            None => grid(terms, settings.bins)?,
        };
        let sizes = layer_sizes(terms.inputs(), &settings.replay.hidden, choices.count());
        let encoding = settings.replay.encoding(Algorithm::Dqn, terms)?;
        let network = Trained::new(&encoding, &sizes, 1.0, seed, 0);
        let DqnSettings { epsilon, final_epsilon, exploration, double, .. } = *settings;
        Ok(Self {
            choices,
            target: network.network.clone(),
            network,
            double,
            epsilon: LinearSchedule { start: epsilon, end: final_epsilon, share: exploration },
        })
    }

    /// Returns the gradient and loss of some samples of a batch.
    fn part(&self, batch: &Batch, range: &core::ops::Range<usize>) -> CriticPart {
        let share = 1.0 / batch.count() as f32;
        let next = columns(&batch.next, range);
        let values = self.target.forward(next.clone());
        let chosen = self.double.then(|| self.network.network.forward(next));
        let chosen = chosen.as_ref().map_or(values.output(), |trace| trace.output());
        let value = |column: usize| values.output()[(best(chosen.column(column).iter().copied()), column)];
        let targets = batch.targets(range, (0..range.len()).map(value));
        let trace = self.network.network.forward(columns(&batch.observations, range));
        let mut by_output = DMatrix::<f32>::zeros(self.choices.count(), range.len());
        let mut part = CriticPart::default();
        for (column, target) in targets.iter().enumerate() {
            let choice = batch.actions[(0, range.start + column)] as usize;
            let value = trace.output()[(choice, column)];
            let error = value - target;
            by_output[(choice, column)] = share * error.clamp(-1.0, 1.0);
            let huber = if error.abs() < 1.0 { 0.5 * error * error } else { error.abs() - 0.5 };
            part.loss += f64::from(share * huber);
            part.value += f64::from(share * value);
        }
        part.gradients.push(self.network.network.gradients(&trace, by_output));
        part
    }
}

impl Method for Dqn {
    fn algorithm(&self) -> Algorithm {
        Algorithm::Dqn
    }

    fn measures(&self) -> &'static [&'static str] {
        &MEASURES
    }

    fn width(&self) -> usize {
        1
    }

    fn act_randomly(&self, exploration: Exploration, out: &mut [f32]) {
        for (world, choice) in out.iter_mut().enumerate() {
            *choice = exploration.random(world).random_range(0..self.choices.count()) as f32;
        }
    }

    fn explore(&self, observations: DMatrix<f32>, exploration: Exploration, out: &mut [f32]) {
        let epsilon = self.epsilon.value(exploration.steps, exploration.total);
        let trace = self.network.network.forward(observations);
        let choices = self.choices.count();
        for (world, choice) in out.iter_mut().enumerate() {
            let mut random = exploration.random(world);
            let is_random = random.random::<f64>() < epsilon;
            let column = trace.output().column(world);
            let index =
                if is_random { random.random_range(0..choices) } else { best(column.iter().copied()) };
            *choice = index as f32;
        }
    }

    fn command(&self, stored: &[f32], action: &mut [f32]) {
        action.copy_from_slice(self.choices.row(stored[0] as usize));
    }

    fn learn(
        &mut self,
        batch: &Batch,
        gradient: Gradient<'_>,
        watch: &mut Stopwatch,
    ) -> Result<Vec<f64>, LearnerError> {
        let parts = map_chunks(gradient.threads, &batch.chunks(), |range| self.part(batch, range));
        let loss = parts.iter().map(|part| part.loss).sum();
        let value = parts.iter().map(|part| part.value).sum();
        check_finite(gradient.update, "loss of the values", loss)?;
        let gradients = parts.into_iter().flat_map(|part| part.gradients);
        watch.lap(Phase::Gradient);
        self.network.step(&sum(gradients), gradient.settings.rate);
        track(&mut self.target, &self.network.network, gradient.settings.polyak as f32);
        watch.lap(Phase::Optimiser);
        Ok(vec![loss, value])
    }

    fn policy(&self) -> TrainedNetwork {
        let head = Head::Choice { table: self.choices.rows().to_vec() };
        TrainedNetwork::new(&self.network.network, head)
    }

    fn parameters(&self) -> Vec<Vec<f32>> {
        vec![self.network.network.to_vec(), self.target.to_vec()]
    }

    fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        self.network.write("values", writer)?;
        writer.numbers("values.target", self.target.to_vec());
        Ok(())
    }

    fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        self.network.read("values", reader)?;
        reader.network("values.target", &mut self.target)
    }
}
