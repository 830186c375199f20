//! One world and its episodes.

use std::sync::Arc;

use motorium_physics::{Engine, ResetError, Simulation, Simulator as _};
use rand::RngExt as _;

use super::EnvironmentError;
use crate::random::{Counter, Purpose};
use crate::task::{Task, Terms, Verdict};

/// End of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// A termination with the verdict failure, or a physics step that failed.
    Failure,
    /// A termination with the verdict success.
    Success,
    /// The longest duration: the episode is truncated, and the state after it still has a value.
    Truncated,
}

impl End {
    /// True if nothing follows the final state; false for a truncated episode.
    pub fn is_terminal(self) -> bool {
        self != Self::Truncated
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Reward of the state after the step.
    pub reward: f64,
    /// End of the episode in this step.
    pub end: Option<End>,
}

/// The running episode of a world, without its simulation.
#[derive(Clone, Debug)]
pub(super) struct Episode {
    pub(super) seed: u64,
    world: u64,
    /// Number of the episode.
    pub(super) number: u64,
    /// Steps of the policy so far.
    pub(super) step: usize,
    /// Observation with its histories.
    pub(super) observation: Vec<f32>,
    /// All actions of the episode, from which it can be replayed.
    pub(super) actions: Vec<f32>,
    newest: Vec<f32>,
    before: Vec<f32>,
    /// Memory of commands.
    values: Vec<f64>,
    joints: Vec<f64>,
}

impl Episode {
    pub(super) fn new(terms: &Terms, seed: u64, world: u64, drives: usize) -> Self {
        let actions = terms.actions();
        Self {
            seed,
            world,
            number: 0,
            step: 0,
            observation: vec![0.0; terms.inputs()],
            actions: Vec::with_capacity(actions * terms.steps()),
            newest: vec![0.0; actions],
            before: vec![0.0; actions],
            values: vec![0.0; actions],
            joints: vec![0.0; drives],
        }
    }

    /// Starts episode `number`.
    pub(super) fn begin<E: Engine>(
        &mut self,
        terms: &Terms,
        simulation: &mut Simulation<E>,
        number: u64,
    ) -> Result<(), EnvironmentError> {
        self.number = number;
        self.step = 0;
        self.actions.clear();
        self.newest.fill(0.0);
        self.before.fill(0.0);
        let counter = Counter { seed: self.seed, world: self.world, episode: number, step: 0 };
        let (position, velocity, spread) = terms.start();
        let mut random = counter.stream(Purpose::Start);
        let velocity: Vec<f64> = velocity
            .iter()
            .map(|v| {
                let share: f64 = random.random();
                v + spread * (2.0 * share - 1.0)
            })
            .collect();
        let started = match terms.draws() {
            None => simulation.reset(position, &velocity),
            Some(draws) => {
                let start = draws.draw(counter.number(Purpose::Start), 0);
                simulation.reset_with(&start.properties, &start.q, &velocity)
            }
        };
        started.map_err(|source: ResetError| EnvironmentError::Reset {
            world: self.world,
            episode: number,
            source,
        })?;
        terms.observe(simulation, &self.newest, true, &mut self.observation);
        Ok(())
    }

    /// Applies an action for one step of the policy.
    pub(super) fn advance<E: Engine>(
        &mut self,
        terms: &Terms,
        simulation: &mut Simulation<E>,
        action: &[f32],
    ) -> Step {
        self.before.copy_from_slice(&self.newest);
        self.newest.copy_from_slice(action);
        self.actions.extend_from_slice(action);
        terms.command(simulation, action, (&mut self.values, &mut self.joints));
        let (count, dt) = terms.physics_steps();
        let is_stepped = (0..count).all(|_| simulation.step(dt).is_ok());
        self.step += 1;
        let actions = crate::task::Actions { newest: &self.newest, before: &self.before };
        let outcome = terms.evaluate(simulation, actions);
        terms.observe(simulation, &self.newest, false, &mut self.observation);
        let verdict = if is_stepped { outcome.end } else { Some(Verdict::Failure) };
        let end = match verdict {
            Some(Verdict::Failure) => Some(End::Failure),
            Some(Verdict::Success) => Some(End::Success),
            None if self.step >= terms.steps() => Some(End::Truncated),
            None => None,
        };
        Step { reward: outcome.reward, end }
    }
}

/// One world of a task.
///
/// ```
/// use std::path::Path;
/// use motorium_learners::environment::Environment;
/// use motorium_learners::task::Task;
/// use motorium_physics::{ArticulatedSimulator, Options, World};
/// use motorium_robots::load;
///
/// let text = r#"
///     title = "Swing"
///     robot = "pendulum"
///     step = 0.01
///     decimation = 2
///     duration = 0.1
///     observations = [{ term = "joint_positions" }]
///     rewards = [{ term = "joint_cosine", joints = ["hinge"], weight = -1.0 }]
///     start = { position = [0.5] }
///     action = { joints = ["hinge"], kind = "effort", default_pose = [0.0], clip = [-1.0, 1.0] }
/// "#;
/// let task = Task::parse(text)?;
/// let model = load(&task.robot, Path::new("."))?.model;
/// let simulation = ArticulatedSimulator::new(model, World::default(), &[0.5], Options::default())?;
/// let mut environment = Environment::new(&task, simulation, 1, 0)?;
/// assert_eq!(environment.reset()?, [0.5]);
/// let steps: Vec<_> = (0..5).map(|_| environment.step(&[0.0])).collect();
/// assert!(steps[4].end.is_some_and(|end| !end.is_terminal()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Environment<E> {
    simulation: Simulation<E>,
    terms: Arc<Terms>,
    episode: Episode,
    /// Number of the next episode.
    next: u64,
}

impl<E: Engine> Environment<E> {
    /// World `world` of a training run with a seed, before its first episode.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] where the task does not fit the robot.
    pub fn new(
        task: &Task,
        mut simulation: Simulation<E>,
        seed: u64,
        world: u64,
    ) -> Result<Self, EnvironmentError> {
        let terms = Arc::new(Terms::new(task, &mut simulation)?);
        let episode = Episode::new(&terms, seed, world, simulation.joint_names().len());
        let mut made = Self { simulation, terms, episode, next: 0 };
        made.episode.begin(&made.terms, &mut made.simulation, 0)?;
        Ok(made)
    }

    /// The terms of the task.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// The simulation.
    pub fn simulation(&self) -> &Simulation<E> {
        &self.simulation
    }

    /// Starts the next episode and returns its first observation.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`].
    pub fn reset(&mut self) -> Result<&[f32], EnvironmentError> {
        let number = self.next;
        self.next += 1;
        self.episode.begin(&self.terms, &mut self.simulation, number)?;
        Ok(&self.episode.observation)
    }

    /// The observation after the last step or reset.
    pub fn observation(&self) -> &[f32] {
        &self.episode.observation
    }

    /// Applies an action for one step of the policy. After an end, [`reset`](Self::reset) follows.
    ///
    /// # Panics
    ///
    /// If the action has another number of entries than the task.
    pub fn step(&mut self, action: &[f32]) -> Step {
        self.episode.advance(&self.terms, &mut self.simulation, action)
    }
}
