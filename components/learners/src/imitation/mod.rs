//! Imitation learning: a network learns the actions of an expert, which is another policy for the same task.
//!
//! An iteration steps all worlds, labels every observation with the expert's action, and fits the network to
//! all labels so far: by least squares or, for a task with discrete choices, by the cross-entropy of the
//! choices. In iteration `i`, counted from 0, the expert acts with probability `beta decay^i`, otherwise the
//! network acts. One iteration in which only the expert acts is behaviour cloning. With further iterations,
//! the algorithm is DAgger, whose labels cover the states that the network reaches. Recorded observations and
//! actions can replace the steps of the first iteration.
//!
//! Results are bit-for-bit reproducible on any number of threads.
//!
//! Source: Ross, Gordon, Bagnell, *A reduction of imitation learning and structured prediction to no-regret
//! online learning*, AISTATS 2011.

mod error;
pub mod movements;
mod recorded;
mod regression;
mod run;
mod settings;

use motorium_models::networks::Perceptron;
use motorium_models::policy::PolicyNetwork;
use motorium_physics::{BuildError, Engine, Simulation};
use rand::RngExt as _;
use serde::Serialize;

pub use error::ImitationError;
pub use recorded::{Recorded, RecordedError};
pub use regression::Regression;
pub use run::{Run, RunError, Sources, Summary};
pub use settings::ImitationSettings;

use crate::environment::{EnvironmentError, VectorEnvironment};
use crate::learner::{Encoding, Head, Normaliser, TrainedNetwork};
use crate::random::{Counter, Purpose};
use crate::task::{Choices, Task, Terms, best};

/// An imitation algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// Behaviour cloning: only the expert acts.
    Clone,
    /// DAgger: the expert and the learned policy act, and the expert labels all observations.
    Dagger,
}

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 2] = [Self::Clone, Self::Dagger];

    /// Returns the name that the command line and policies use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clone => "clone",
            Self::Dagger => "dagger",
        }
    }
}

/// Progress of a run after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// Number of iterations so far.
    pub iteration: u64,
    /// Number of labels (expert actions) so far.
    pub labels: usize,
    /// Probability that the expert acted in a step of the iteration; 1 for recordings.
    pub beta: f64,
    /// Number of episodes that ended in the iteration.
    pub episodes: u64,
    /// Mean return of these episodes; `None` if no episode ended.
    pub mean_return: Option<f64>,
    /// Mean squared action error in the last pass over the labels; for choices, the mean cross-entropy.
    pub loss: f64,
}

/// A run of imitation learning: worlds, expert, network and labels.
pub struct Imitation<E> {
    seed: u64,
    worlds: VectorEnvironment<E>,
    /// One expert per world; empty if all labels are recorded.
    experts: Vec<PolicyNetwork>,
    regression: Regression,
    /// Choices of a discrete task, which are labelled by their number.
    choices: Option<Choices>,
    /// Return of the running episode of each world.
    running: Vec<f64>,
}

impl<E: Engine + Send> Imitation<E> {
    /// Creates a run that has not performed any iteration yet. The expert is a network for the observations
    /// and actions of the task. `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if a setting is invalid, the task does not fit the robot, or a simulation cannot
    /// be built.
    pub fn new(
        task: &Task,
        settings: ImitationSettings,
        expert: &PolicyNetwork,
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        let experts = vec![expert.clone(); settings.worlds];
        Self::with_experts(task, settings, experts, (seed, threads), build)
    }

    /// Creates a run of behaviour cloning from recorded actions. The run has one iteration and no expert.
    ///
    /// # Errors
    ///
    /// [`RecordedError`] if a recording does not fit the task, or an environment fails.
    pub fn from_recorded(
        task: &Task,
        settings: ImitationSettings,
        recorded: &[Recorded],
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, RecordedError> {
        let settings = ImitationSettings { iterations: 1, worlds: 1, ..settings };
        let mut made = Self::with_experts(task, settings, Vec::new(), (seed, threads), build)?;
        made.add(recorded)?;
        Ok(made)
    }

    fn with_experts(
        task: &Task,
        settings: ImitationSettings,
        experts: Vec<PolicyNetwork>,
        (seed, threads): (u64, usize),
        build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        settings.check()?;
        let worlds = VectorEnvironment::new(task, (settings.worlds, threads), seed, build)?;
        let choices = worlds.terms().choices().cloned();
        let (inputs, running) = (worlds.terms().inputs(), vec![0.0; settings.worlds]);
        let encoding = Encoding::new("dagger", &settings.convolutions, worlds.terms().policy())?;
        let labels = match &choices {
            Some(choices) => (inputs, vec![true; choices.count()], true),
            None => (inputs, worlds.terms().active_actions(), false),
        };
        let regression = Regression::with_labels(labels, &encoding, settings, seed)?;
        Ok(Self { seed, experts, running, regression, choices, worlds })
    }

    /// Adds recorded observations with the actions of an expert. Recordings that are added before the first
    /// iteration are used in place of the environment steps that the first iteration would collect.
    ///
    /// # Errors
    ///
    /// [`RecordedError`] if the recording does not fit the task.
    pub fn add(&mut self, recorded: &[Recorded]) -> Result<(), RecordedError> {
        let terms = self.worlds.terms();
        for recorded in recorded {
            recorded.check([terms.inputs(), terms.actions()])?;
            let mut labels = Vec::new();
            for action in recorded.actions.chunks_exact(terms.actions()) {
                label(terms, action, &mut labels);
            }
            self.regression.push(&recorded.observations, &labels);
        }
        Ok(())
    }

    /// Returns the settings.
    pub fn settings(&self) -> &ImitationSettings {
        self.regression.settings()
    }

    /// Returns `true` once all iterations are complete.
    pub fn is_finished(&self) -> bool {
        self.regression.fits() >= self.settings().iterations
    }

    /// Runs one iteration.
    ///
    /// # Errors
    ///
    /// [`ImitationError`] if the environment fails or the loss is not finite.
    pub fn advance(&mut self) -> Result<Progress, ImitationError> {
        let ImitationSettings { beta, decay, .. } = *self.settings();
        let beta = beta * decay.powi(i32::try_from(self.regression.fits()).unwrap_or(i32::MAX));
        let is_recorded = self.regression.fits() == 0 && self.regression.labels() > 0;
        let (beta, episodes, sum) = if is_recorded || self.experts.is_empty() {
            (1.0, 0, 0.0)
        } else {
            let (episodes, sum) = self.collect(beta)?;
            (beta, episodes, sum)
        };
        let loss = self.regression.fit()?;
        let (iteration, labels) = (self.regression.fits(), self.regression.labels());
        let mean_return = (episodes > 0).then(|| sum / episodes as f64);
        Ok(Progress { iteration, labels, beta, episodes, mean_return, loss })
    }

    /// Returns the trained network for raw observations.
    pub fn policy(&self) -> TrainedNetwork {
        let mut policy = self.regression.policy();
        if let Some(choices) = &self.choices {
            policy.head = Head::Choice { table: choices.rows().to_vec() };
        }
        policy
    }

    /// Returns the network and the normalisation of its observations.
    pub fn network(&self) -> (&Perceptron, &Normaliser) {
        self.regression.network()
    }

    /// Returns the SHA-256 digest of all weights as hexadecimal digits.
    pub fn weights_sha256(&self) -> String {
        self.regression.weights_sha256()
    }

    /// Steps all worlds and labels their observations. Returns the number of episodes that ended and the sum
    /// of their returns.
    fn collect(&mut self, beta: f64) -> Result<(u64, f64), EnvironmentError> {
        let (inputs, width) = (self.worlds.terms().inputs(), self.worlds.terms().actions());
        let worlds = self.experts.len();
        let mut actions = vec![0.0; worlds * width];
        let mut labels = Vec::new();
        let (mut episodes, mut sum) = (0, 0.0);
        let episode = self.regression.fits();
        for step in 0..self.settings().steps.div_ceil(worlds as u64) {
            let seen = self.worlds.observations();
            let own = self.regression.predict(seen);
            let outputs = own.len() / worlds;
            labels.clear();
            for (world, expert) in self.experts.iter_mut().enumerate() {
                expert.observation_mut().copy_from_slice(&seen[world * inputs..][..inputs]);
                let first = labels.len();
                label(self.worlds.terms(), expert.run(), &mut labels);
                let counter = Counter { seed: self.seed, world: world as u64, episode, step };
                let acts = counter.stream(Purpose::Mixture).random::<f64>() < beta;
                let (labelled, own) = (&labels[first..], &own[world * outputs..][..outputs]);
                let action = match &self.choices {
                    Some(choices) if acts => choices.row(labelled[0] as usize),
                    Some(choices) => choices.row(best(own.iter().copied())),
                    None if acts => labelled,
                    None => own,
                };
                actions[world * width..][..width].copy_from_slice(action);
            }
            self.regression.push(seen, &labels);
            for (world, step) in self.worlds.step(&actions)?.iter().enumerate() {
                self.running[world] += step.reward;
                if step.end.is_some() {
                    episodes += 1;
                    sum += core::mem::take(&mut self.running[world]);
                    self.experts[world].reset();
                }
            }
        }
        Ok((episodes, sum))
    }
}

/// Appends the label of an action: its numbers within their bounds, or the number of the nearest choice.
fn label(terms: &Terms, action: &[f32], labels: &mut Vec<f32>) {
    match terms.choices() {
        Some(choices) => labels.push(choices.nearest(action) as f32),
        None => labels.extend(action.iter().map(|number| terms.targets().clipped(f64::from(*number)) as f32)),
    }
}

#[cfg(test)]
mod tests;
