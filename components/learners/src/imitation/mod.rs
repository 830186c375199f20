//! Imitation: a network learns the actions of an expert, another policy for the same task.
//!
//! An iteration steps all worlds, labels every observation with the action of the expert, and fits the
//! network to all labels so far by least squares. In iteration `i`, counted from 0, the expert acts with
//! probability `beta decay^i`, else the network does. One iteration of the expert alone is behaviour cloning;
//! more are DAgger, whose labels cover the states that the network itself reaches.
//!
//! Imitation repeats to the bit on any number of threads.
//!
//! Source: Ross, Gordon, Bagnell, *A reduction of imitation learning and structured prediction to no-regret
//! online learning*, AISTATS 2011.

mod run;
mod settings;

use motorium_models::networks::{Adam, Perceptron};
use motorium_models::policy::PolicyNetwork;
use motorium_physics::{BuildError, Engine, Simulation};
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use serde::Serialize;

pub use run::{Run, RunError, Summary};
pub use settings::ImitationSettings;

use crate::environment::{EnvironmentError, VectorEnvironment};
use crate::learner::{Head, Normaliser, TrainedNetwork, layer_sizes, numbers_sha256};
use crate::random::{Counter, Purpose};
use crate::task::Task;

/// An algorithm of imitation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// Behaviour cloning: the expert alone acts.
    Clone,
    /// DAgger.
    Dagger,
}

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 2] = [Self::Clone, Self::Dagger];

    /// Name on the command line and in policies.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clone => "clone",
            Self::Dagger => "dagger",
        }
    }
}

/// The errors of imitation.
#[derive(Debug, thiserror::Error)]
pub enum ImitationError {
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The loss is not finite.
    #[error(
        "iteration {iteration}: the loss is {loss}, expected a finite number\n\
         help: lower `rate` or clip the observations of the task"
    )]
    NotFinite {
        /// Number of the iteration.
        iteration: u64,
        /// The loss.
        loss: f64,
    },
}

/// Progress after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// Iterations so far.
    pub iteration: u64,
    /// Labels so far.
    pub labels: usize,
    /// Probability that the expert acted.
    pub beta: f64,
    /// Episodes that ended in the iteration.
    pub episodes: u64,
    /// Their mean return, or `None` without one.
    pub mean_return: Option<f64>,
    /// Mean squared error of the actions in the last pass over the labels.
    pub loss: f64,
}

/// A run of imitation: worlds, expert, network and labels.
pub struct Imitation<E> {
    settings: ImitationSettings,
    seed: u64,
    worlds: VectorEnvironment<E>,
    /// One for each world.
    experts: Vec<PolicyNetwork>,
    network: Perceptron,
    normaliser: Normaliser,
    /// Actions that move a joint.
    active: Vec<bool>,
    observations: Vec<f32>,
    labels: Vec<f32>,
    /// Return of the running episode of each world.
    running: Vec<f64>,
    iteration: u64,
}

impl<E: Engine + Send> Imitation<E> {
    /// A run before its first step; `build` makes the simulation of a world. The expert is a network for the
    /// observations and actions of the task.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`].
    pub fn new(
        task: &Task,
        settings: ImitationSettings,
        expert: &PolicyNetwork,
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        settings.check()?;
        let worlds = VectorEnvironment::new(task, (settings.worlds, threads), seed, build)?;
        let (inputs, actions) = (worlds.terms().inputs(), worlds.terms().actions());
        let sizes = layer_sizes(inputs, &settings.hidden, actions);
        let mut random = Counter { seed, ..Counter::default() }.stream(Purpose::Weights);
        Ok(Self {
            seed,
            experts: vec![expert.clone(); settings.worlds],
            network: Perceptron::random(&sizes, 0.01, &mut random),
            normaliser: Normaliser::new(inputs),
            active: worlds.terms().active_actions(),
            observations: Vec::new(),
            labels: Vec::new(),
            running: vec![0.0; settings.worlds],
            iteration: 0,
            worlds,
            settings,
        })
    }

    /// The settings.
    pub fn settings(&self) -> &ImitationSettings {
        &self.settings
    }

    /// True once all iterations of the settings are made.
    pub fn is_finished(&self) -> bool {
        self.iteration >= self.settings.iterations
    }

    /// Makes one iteration.
    ///
    /// # Errors
    ///
    /// [`ImitationError`].
    pub fn advance(&mut self) -> Result<Progress, ImitationError> {
        let decay = i32::try_from(self.iteration).unwrap_or(i32::MAX);
        let beta = self.settings.beta * self.settings.decay.powi(decay);
        let (episodes, sum) = self.collect(beta)?;
        let loss = self.fit()?;
        self.iteration += 1;
        let (iteration, labels) = (self.iteration, self.labels.len() / self.active.len());
        let mean_return = (episodes > 0).then(|| sum / episodes as f64);
        Ok(Progress { iteration, labels, beta, episodes, mean_return, loss })
    }

    /// The network on raw observations: the normalisation is part of its first layer.
    pub fn policy(&self) -> TrainedNetwork {
        let mut layers = self.network.rows();
        self.normaliser.fold(&mut layers[0]);
        TrainedNetwork { layers, head: Head::Linear }
    }

    /// The network and the normalisation of its observations.
    pub fn network(&self) -> (&Perceptron, &Normaliser) {
        (&self.network, &self.normaliser)
    }

    /// SHA-256 of all weights, in hexadecimal.
    pub fn weights_sha256(&self) -> String {
        let layers = self.policy().layers;
        numbers_sha256(layers.iter().flat_map(|(weights, bias)| [&weights[..], &bias[..]]))
    }

    /// Steps all worlds and labels their observations. Returns the number of episodes that ended and the sum
    /// of their returns.
    fn collect(&mut self, beta: f64) -> Result<(u64, f64), EnvironmentError> {
        let (inputs, width) = (self.worlds.terms().inputs(), self.active.len());
        let worlds = self.settings.worlds;
        let first = self.observations.len();
        let mut actions = vec![0.0; worlds * width];
        let mut scaled = vec![0.0; worlds * inputs];
        let (mut episodes, mut sum) = (0, 0.0);
        for step in 0..self.settings.steps.div_ceil(worlds as u64) {
            let seen = self.worlds.observations();
            self.observations.extend_from_slice(seen);
            self.normaliser.apply(seen, &mut scaled);
            let own = self.network.forward(DMatrix::from_column_slice(inputs, worlds, &scaled));
            for (world, expert) in self.experts.iter_mut().enumerate() {
                expert.observation_mut().copy_from_slice(&seen[world * inputs..][..inputs]);
                let targets = self.worlds.terms().targets();
                let label = expert.run().iter().map(|number| targets.clipped(f64::from(*number)) as f32);
                self.labels.extend(label);
                let counter = Counter { seed: self.seed, world: world as u64, episode: self.iteration, step };
                let acts = counter.stream(Purpose::Mixture).random::<f64>() < beta;
                let action = &mut actions[world * width..][..width];
                if acts {
                    action.copy_from_slice(&self.labels[self.labels.len() - width..]);
                } else {
                    action.copy_from_slice(own.output().column(world).as_slice());
                }
            }
            for (world, step) in self.worlds.step(&actions)?.iter().enumerate() {
                self.running[world] += step.reward;
                if step.end.is_some() {
                    episodes += 1;
                    sum += core::mem::take(&mut self.running[world]);
                    self.experts[world].reset();
                }
            }
        }
        self.normaliser.update(&self.observations[first..]);
        Ok((episodes, sum))
    }

    /// Fits the network to all labels; returns the loss of the last pass.
    fn fit(&mut self) -> Result<f64, ImitationError> {
        let width = self.active.len();
        let inputs = self.observations.len() * width / self.labels.len();
        let mut scaled = vec![0.0; self.observations.len()];
        self.normaliser.apply(&self.observations, &mut scaled);
        let mut adam = Adam::new(&[self.network.parameters()]);
        let mut order: Vec<usize> = (0..self.labels.len() / width).collect();
        let active = self.active.iter().filter(|active| **active).count().max(1);
        let mut loss = 0.0;
        for epoch in 0..self.settings.epochs as u64 {
            let counter = Counter { seed: self.seed, world: 0, episode: self.iteration, step: epoch };
            order.shuffle(&mut counter.stream(Purpose::Shuffle));
            loss = 0.0;
            for batch in order.chunks(self.settings.minibatch) {
                let mut input = DMatrix::zeros(inputs, batch.len());
                for (mut column, k) in input.column_iter_mut().zip(batch) {
                    column.copy_from_slice(&scaled[k * inputs..][..inputs]);
                }
                let trace = self.network.forward(input);
                let mut gradient = DMatrix::zeros(width, batch.len());
                for (column, k) in batch.iter().enumerate() {
                    for (row, label) in self.labels[k * width..][..width].iter().enumerate() {
                        if self.active[row] {
                            let error = trace.output()[(row, column)] - label;
                            loss += f64::from(error * error);
                            gradient[(row, column)] = 2.0 * error / (batch.len() * active) as f32;
                        }
                    }
                }
                let gradient = self.network.gradients(&trace, gradient);
                let mut parameters = self.network.to_vec();
                let rate = self.settings.rate as f32;
                adam.step([&mut parameters[..]], [&gradient[..]], rate, 0.0);
                self.network.set(&parameters);
            }
            loss /= (order.len() * active) as f64;
        }
        if !loss.is_finite() {
            return Err(ImitationError::NotFinite { iteration: self.iteration, loss });
        }
        Ok(loss)
    }
}

#[cfg(test)]
mod tests;
