//! Off-policy learning: steps of all worlds are stored in a ring buffer, and gradients use random samples
//! from this buffer.
//!
//! [`OffPolicy`] steps the worlds, fills the [`ReplayBuffer`] and samples it; a method such as [soft
//! actor-critic](crate::sac) explores and learns from the samples. The first steps are random. Observations
//! are normalised by their running mean and standard deviation, which are updated in every step, as in
//! Stable-Baselines3. Samples and noise depend only on the seed and the number of the gradient step.

mod bounds;
mod buffer;
mod settings;
mod trained;

use core::ops::Range;

use motorium_physics::{BuildError, Engine, Simulation};
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

pub(crate) use bounds::Bounds;
pub use buffer::{NStep, ReplayBuffer};
pub use settings::ReplaySettings;
pub(crate) use trained::{CriticPart, Critics, Trained, stack, sum, track};

use crate::environment::{EnvironmentError, VectorEnvironment};
use crate::learner::{
    Algorithm, CHUNK, CheckpointError, CheckpointReader, CheckpointWriter, Costs, Episodes, Learner,
    LearnerError, Normaliser, Phase, Progress, Stopwatch, TrainedNetwork, numbers_sha256,
};
use crate::random::{Counter, Purpose};
use crate::task::{Task, TaskError, Terms};

/// Samples of a gradient step. Each column of a matrix is a sample.
#[derive(Clone, Debug)]
pub struct Batch {
    /// Normalised observations.
    pub observations: DMatrix<f32>,
    /// Actions as stored in the buffer.
    pub actions: DMatrix<f32>,
    /// Discounted rewards over up to `n_step` steps.
    pub rewards: Vec<f32>,
    /// Factor of the value of the next observation, for each sample.
    pub discounts: Vec<f32>,
    /// Normalised observations after the last step of each discounted sum.
    pub next: DMatrix<f32>,
}

impl Batch {
    /// Returns the number of samples.
    pub fn count(&self) -> usize {
        self.rewards.len()
    }

    /// Returns ranges of samples whose gradients are summed separately. The ranges do not depend on the
    /// number of threads.
    pub fn chunks(&self) -> Vec<Range<usize>> {
        let count = self.count();
        (0..count).step_by(CHUNK).map(|first| first..count.min(first + CHUNK)).collect()
    }

    /// Returns the targets `reward + discount value` of the samples in `range`.
    pub fn targets(&self, range: &Range<usize>, values: impl IntoIterator<Item = f32>) -> Vec<f32> {
        let samples = self.rewards[range.clone()].iter().zip(&self.discounts[range.clone()]);
        // a terminated episode has no value, whatever the network computes
        let target = |((reward, discount), value): ((&f32, &f32), f32)| {
            if *discount == 0.0 { *reward } else { reward + discount * value }
        };
        samples.zip(values).map(target).collect()
    }
}

/// Copies columns of a matrix.
pub(crate) fn columns(matrix: &DMatrix<f32>, range: &Range<usize>) -> DMatrix<f32> {
    matrix.columns(range.start, range.len()).into_owned()
}

/// Context of a gradient step: its number, threads and settings.
#[derive(Clone, Copy, Debug)]
pub struct Gradient<'a> {
    /// Seed of the run.
    pub seed: u64,
    /// Number of preceding gradient steps.
    pub number: u64,
    /// Number of the update, which is used only in error messages.
    pub update: u64,
    /// Number of threads, which does not change the result.
    pub threads: usize,
    /// Settings of the run.
    pub settings: &'a ReplaySettings,
}

impl Gradient<'_> {
    /// Returns standard normal noise. Each column is a sample.
    pub fn noise(&self, rows: usize, columns: usize) -> DMatrix<f32> {
        let counter = Counter { seed: self.seed, step: self.number, ..Counter::default() };
        let mut random = counter.stream(Purpose::Noise);
        DMatrix::from_fn(rows, columns, |_, _| StandardNormal.sample(&mut random))
    }
}

/// Context of an exploration step: its seed and time.
#[derive(Clone, Copy, Debug)]
pub struct Exploration {
    /// Seed of the run.
    pub seed: u64,
    /// Number of steps before this step, in all worlds together.
    pub steps: u64,
    /// Number of steps of the complete run, in all worlds together.
    pub total: u64,
}

impl Exploration {
    /// Returns a generator of the random numbers of a world.
    pub fn random(&self, world: usize) -> rand_pcg::Pcg64 {
        let counter = Counter { seed: self.seed, world: world as u64, episode: 0, step: self.steps };
        counter.stream(Purpose::Action)
    }
}

/// Exploration and learning rule of an off-policy algorithm.
pub trait Method {
    /// Returns the algorithm.
    fn algorithm(&self) -> Algorithm;

    /// Returns the names of the values that [`learn`](Self::learn) returns.
    fn measures(&self) -> &'static [&'static str];

    /// Returns the length of an action as stored in the buffer.
    fn width(&self) -> usize;

    /// Writes random actions for all worlds, world by world.
    fn act_randomly(&self, exploration: Exploration, out: &mut [f32]);

    /// Writes actions with exploration. Each column of the normalised observations and of the actions is a
    /// world.
    fn explore(&self, observations: DMatrix<f32>, exploration: Exploration, out: &mut [f32]);

    /// Converts an action as stored in the buffer to an action of the task.
    fn command(&self, stored: &[f32], action: &mut [f32]);

    /// Performs one step of all optimisers. `watch` measures the time of gradients and optimisers.
    ///
    /// # Errors
    ///
    /// [`LearnerError::NotFinite`] if a term of the loss is not finite.
    fn learn(
        &mut self,
        batch: &Batch,
        gradient: Gradient<'_>,
        watch: &mut Stopwatch,
    ) -> Result<Vec<f64>, LearnerError>;

    /// Returns the policy without exploration. Its inputs are normalised observations.
    fn policy(&self) -> TrainedNetwork;

    /// Returns all parameters, including the parameters of target networks.
    fn parameters(&self) -> Vec<Vec<f32>>;

    /// Adds networks and optimisers to a checkpoint.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if a value does not serialise.
    fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError>;

    /// Restores networks and optimisers.
    ///
    /// # Errors
    ///
    /// [`CheckpointError`] if a network or optimiser is missing or has another size.
    fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError>;
}

/// State of a training run besides its networks, buffer and worlds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    seed: u64,
    updates: u64,
    steps: u64,
    gradients: u64,
    observations: Normaliser,
    episodes: Episodes,
}

/// A training run of an off-policy algorithm.
pub struct OffPolicy<E, M> {
    settings: ReplaySettings,
    threads: usize,
    method: M,
    worlds: VectorEnvironment<E>,
    buffer: ReplayBuffer,
    state: State,
    watch: Stopwatch,
}

impl<E: Engine + Send, M: Method> OffPolicy<E, M> {
    /// Creates a training run that has not performed any step yet. `method` creates the learning rule for the
    /// terms of the task, and `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built.
    ///
    /// # Panics
    ///
    /// If a count in the settings is 0.
    pub fn new(
        task: &Task,
        settings: ReplaySettings,
        (seed, threads): (u64, usize),
        method: impl FnOnce(&Terms) -> Result<M, TaskError>,
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        let worlds = VectorEnvironment::new(task, (settings.worlds, threads), seed, build)?;
        let method = method(worlds.terms())?;
        let inputs = worlds.terms().inputs();
        let buffer = ReplayBuffer::new(
            settings.buffer.div_ceil(settings.worlds),
            settings.worlds,
            (inputs, method.width()),
        );
        let state = State {
            seed,
            updates: 0,
            steps: 0,
            gradients: 0,
            observations: settings.encoding(method.algorithm(), worlds.terms())?.normaliser(inputs),
            episodes: Episodes::new(settings.worlds),
        };
        let watch = Stopwatch::start();
        Ok(Self { settings, threads: threads.max(1), method, worlds, buffer, state, watch })
    }

    /// Returns the buffer of the latest steps.
    pub fn buffer(&self) -> &ReplayBuffer {
        &self.buffer
    }

    /// Adds the newest observations of all worlds to the statistics.
    fn observe(&mut self) {
        self.state.observations.update(self.worlds.observations());
    }

    /// Steps all worlds once.
    fn step(&mut self) -> Result<(), EnvironmentError> {
        let worlds = self.settings.worlds;
        let (inputs, actions) = (self.worlds.terms().inputs(), self.worlds.terms().actions());
        let width = self.method.width();
        let State { seed, steps, .. } = self.state;
        if steps == 0 {
            self.observe();
        }
        let before = self.worlds.observations().to_vec();
        self.worlds.set_level(self.worlds.terms().level(steps));
        let exploration = Exploration { seed, steps, total: self.settings.steps };
        let mut stored = vec![0.0; worlds * width];
        if steps < self.settings.warmup {
            self.method.act_randomly(exploration, &mut stored);
        } else {
            let mut normal = DMatrix::<f32>::zeros(inputs, worlds);
            self.state.observations.apply(&before, normal.as_mut_slice());
            self.method.explore(normal, exploration, &mut stored);
        }
        let mut commands = vec![0.0; worlds * actions];
        for (stored, command) in stored.chunks_exact(width).zip(commands.chunks_exact_mut(actions)) {
            self.method.command(stored, command);
        }
        self.watch.lap(Phase::Policy);
        self.worlds.step(&commands)?;
        self.watch.lap(Phase::Environment);
        let following = |world: usize| {
            let next = &self.worlds.observations()[world * inputs..][..inputs];
            self.worlds.final_observation(world).unwrap_or(next)
        };
        self.buffer.push(&before, &stored, self.worlds.steps(), following);
        for (world, step) in self.worlds.steps().iter().enumerate() {
            self.state.episodes.record(world, step);
        }
        self.state.steps += worlds as u64;
        self.observe();
        self.watch.lap(Phase::Statistics);
        Ok(())
    }

    /// Samples a batch, uniformly and with replacement from all steps in the buffer.
    fn sample(&self) -> Batch {
        let (count, inputs, width) =
            (self.settings.minibatch, self.worlds.terms().inputs(), self.method.width());
        let counter = Counter { seed: self.state.seed, step: self.state.gradients, ..Counter::default() };
        let mut random = counter.stream(Purpose::Replay);
        let mut batch = Batch {
            observations: DMatrix::zeros(inputs, count),
            actions: DMatrix::zeros(width, count),
            rewards: Vec::with_capacity(count),
            discounts: Vec::with_capacity(count),
            next: DMatrix::zeros(inputs, count),
        };
        for column in 0..count {
            let sample = random.random_range(0..self.buffer.samples());
            let found = self.buffer.n_step(sample, self.settings.n_step, self.settings.discount as f32);
            batch.rewards.push(found.reward);
            batch.discounts.push(found.discount);
            batch.actions.column_mut(column).copy_from_slice(self.buffer.action(sample));
            for (matrix, row) in [
                (&mut batch.observations, self.buffer.observation(sample)),
                (&mut batch.next, self.buffer.next_observation(found.last)),
            ] {
                self.state.observations.apply(row, matrix.column_mut(column).as_mut_slice());
            }
        }
        batch
    }
}

impl<E: Engine + Send, M: Method> Learner for OffPolicy<E, M> {
    fn algorithm(&self) -> Algorithm {
        self.method.algorithm()
    }

    fn measures(&self) -> &'static [&'static str] {
        self.method.measures()
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
        self.watch.skip();
        let mut sums = vec![0.0; self.method.measures().len()];
        let mut count = 0.0;
        for _ in 0..self.settings.horizon {
            if self.is_finished() {
                break;
            }
            self.step()?;
            if self.state.steps < self.settings.warmup {
                continue;
            }
            for _ in 0..self.settings.gradients {
                let batch = self.sample();
                let gradient = Gradient {
                    seed: self.state.seed,
                    number: self.state.gradients,
                    update: self.state.updates,
                    threads: self.threads,
                    settings: &self.settings,
                };
                self.watch.lap(Phase::Statistics);
                let values = self.method.learn(&batch, gradient, &mut self.watch)?;
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                count += 1.0;
                self.state.gradients += 1;
            }
        }
        self.state.updates += 1;
        let State { updates, steps, episodes, .. } = &self.state;
        Ok(Progress {
            update: *updates,
            steps: *steps,
            episodes: episodes.ended,
            mean_return: episodes.mean_return(),
            mean_length: episodes.mean_length(),
            values: sums.into_iter().map(|sum| sum / count).collect(),
        })
    }

    fn costs(&self) -> Costs {
        self.watch.costs()
    }

    fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError> {
        let mut writer = CheckpointWriter::new(self.algorithm());
        self.method.write(&mut writer)?;
        self.buffer.write(&mut writer)?;
        writer.worlds(&self.worlds)?;
        writer.value("state", &self.state)?;
        writer.finish()
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), CheckpointError> {
        let mut reader = CheckpointReader::new(bytes, self.algorithm())?;
        self.method.read(&mut reader)?;
        self.buffer.read(&mut reader)?;
        let state: State = reader.value("state")?;
        reader.worlds(state.seed, &mut self.worlds)?;
        let (found, expected) = (state.episodes.worlds(), self.settings.worlds);
        if found != expected {
            return Err(CheckpointError::mismatch("worlds", format!("{found} worlds"), expected.to_string()));
        }
        self.state = state;
        Ok(())
    }

    fn policy(&self) -> TrainedNetwork {
        self.method.policy().normalised(&self.state.observations)
    }

    fn weights_sha256(&self) -> String {
        let parameters = self.method.parameters();
        numbers_sha256(parameters.iter().map(Vec::as_slice))
    }
}
