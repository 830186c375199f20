//! One world and its episodes.

use std::sync::Arc;

use motorium_locomotion::wheels::RobotWheels;
use motorium_physics::{Engine, Simulation, Simulator as _};

use super::EnvironmentError;
use super::stage::{Motion, Stage, Surroundings};
use crate::random::{Counter, Purpose};
use crate::task::{End, Rhythm, Step, Task, Terms, Trial};

/// The running episode of a world, without its simulation.
#[derive(Clone, Debug)]
pub(super) struct Episode {
    pub(super) seed: u64,
    world: u64,
    /// Number of the episode.
    pub(super) number: u64,
    /// Level of the curriculum at its start, 0 to 1.
    pub(super) level: f64,
    trial: Trial,
    /// Observation with its histories.
    pub(super) observation: Vec<f32>,
    /// All actions of the episode, from which it can be replayed.
    pub(super) actions: Vec<f32>,
    rhythm: Option<Rhythm>,
    wheels: Option<RobotWheels>,
    /// Factors of the gain and of the strength of each drive.
    drives: Vec<[f64; 2]>,
    /// Physics steps after which an action takes effect.
    delay: usize,
    /// Buffers for the measurements of links and objects.
    surroundings: Surroundings,
}

impl Episode {
    pub(super) fn new(stage: &Stage, seed: u64, world: u64, drives: usize) -> Self {
        let terms = &stage.terms;
        Self {
            seed,
            world,
            number: 0,
            level: 1.0,
            trial: Trial::with_noise(terms),
            observation: vec![0.0; terms.inputs()],
            actions: Vec::with_capacity(terms.actions() * terms.steps()),
            rhythm: terms.rhythm(),
            wheels: stage.wheels.clone(),
            drives: vec![[1.0; 2]; drives],
            delay: 0,
            surroundings: stage.surroundings(),
        }
    }

    /// Starts episode `number` at a level of the curriculum. Physical properties and the start state are
    /// sampled with `seed`; if it is `None`, the seed is derived from the seed of the run, the world and the
    /// number.
    pub(super) fn begin<E: Engine>(
        &mut self,
        stage: &Stage,
        simulation: &mut Simulation<E>,
        (number, level, seed): (u64, f64, Option<u64>),
    ) -> Result<(), EnvironmentError> {
        (self.number, self.level) = (number, level);
        self.actions.clear();
        if let Some(rhythm) = &mut self.rhythm {
            rhythm.reset();
        }
        let counter = Counter { seed: self.seed, world: self.world, episode: number, step: 0 };
        let seed = seed.unwrap_or_else(|| counter.number(Purpose::Start));
        self.delay = stage.delay(counter);
        stage.begin(simulation, (counter, seed), &mut self.drives)?;
        self.surroundings.begin(counter);
        if let Some(wheels) = &mut self.wheels {
            wheels.begin(&simulation.positions()[..wheels.position().len()]);
        }
        let state = stage.state(simulation, &mut self.surroundings);
        self.trial.begin(&stage.terms, (counter, level), &state);
        self.trial.write(&mut self.observation);
        Ok(())
    }

    /// Steps physics with an action for one policy step. Returns `false` if physics failed.
    pub(super) fn drive<E: Engine>(
        &mut self,
        stage: &Stage,
        simulation: &mut Simulation<E>,
        action: &[f32],
    ) -> bool {
        self.trial.act(&stage.terms, action.iter().map(|number| f64::from(*number)));
        let counter = Counter {
            seed: self.seed,
            world: self.world,
            episode: self.number,
            step: self.trial.step() as u64,
        };
        let motion = Motion {
            before: self.trial.action_before(),
            action: self.trial.action(),
            rhythm: self.rhythm.as_mut(),
            wheels: self.wheels.as_mut(),
        };
        stage.advance(simulation, (counter, motion), (self.delay, &self.drives))
    }

    /// Applies an action for one policy step.
    pub(super) fn advance<E: Engine>(
        &mut self,
        stage: &Stage,
        simulation: &mut Simulation<E>,
        action: &[f32],
    ) -> Step {
        self.actions.extend_from_slice(action);
        let is_stepped = self.drive(stage, simulation, action);
        let state = stage.state(simulation, &mut self.surroundings);
        let step = self.trial.judge(&stage.terms, &state, is_stepped);
        self.trial.write(&mut self.observation);
        step
    }
}

/// Summary of a finished episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpisodeSummary {
    /// Return: the sum of the rewards.
    pub total: f64,
    /// Number of steps.
    pub steps: usize,
    /// Reason for the end of the episode.
    pub end: End,
}

/// One world of a task, which runs one episode after the other.
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
    stage: Arc<Stage>,
    episode: Episode,
    /// Number of the next episode.
    next: u64,
}

impl<E: Engine> Environment<E> {
    /// Creates one world of a training run. `seed` is the seed of the run, `world` the index of the world.
    /// The world is placed at the start of its first episode. The first call of [`reset`](Self::reset) starts
    /// the same episode again.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if the task does not fit the robot.
    pub fn new(
        task: &Task,
        mut simulation: Simulation<E>,
        seed: u64,
        world: u64,
    ) -> Result<Self, EnvironmentError> {
        let stage = Arc::new(Stage::new(task, &mut simulation)?);
        let episode = Episode::new(&stage, seed, world, simulation.joint_names().len());
        let mut made = Self { simulation, stage, episode, next: 0 };
        made.episode.begin(&made.stage, &mut made.simulation, (0, 1.0, None))?;
        Ok(made)
    }

    /// Returns the terms of the task.
    pub fn terms(&self) -> &Terms {
        &self.stage.terms
    }

    /// Returns the simulation.
    pub fn simulation(&self) -> &Simulation<E> {
        &self.simulation
    }

    /// Starts the next episode and returns its first observation.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if the episode cannot start.
    pub fn reset(&mut self) -> Result<&[f32], EnvironmentError> {
        self.start(None)
    }

    /// Starts the next episode with the physical properties and the start state that a physics component in a
    /// graph would sample from `seed`. Returns the first observation.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if the episode cannot start.
    pub fn reset_from(&mut self, seed: u64) -> Result<&[f32], EnvironmentError> {
        self.start(Some(seed))
    }

    fn start(&mut self, seed: Option<u64>) -> Result<&[f32], EnvironmentError> {
        let number = self.next;
        self.next += 1;
        self.episode.begin(&self.stage, &mut self.simulation, (number, 1.0, seed))?;
        Ok(&self.episode.observation)
    }

    /// Runs the next episode to its end. For each step, `act` receives the observation and must write the
    /// action.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if the episode cannot start.
    pub fn run_episode(
        &mut self,
        mut act: impl FnMut(&[f32], &mut [f32]),
    ) -> Result<EpisodeSummary, EnvironmentError> {
        self.reset()?;
        let mut action = vec![0.0; self.terms().actions()];
        let (mut total, mut steps) = (0.0, 0);
        loop {
            act(self.observation(), &mut action);
            let step = self.step(&action);
            total += step.reward;
            steps += 1;
            if let Some(end) = step.end {
                return Ok(EpisodeSummary { total, steps, end });
            }
        }
    }

    /// Returns the observation after the last step or reset.
    pub fn observation(&self) -> &[f32] {
        &self.episode.observation
    }

    /// Returns the current command: forward velocity, velocity to the left \[m/s\] and yaw rate \[rad/s\], or
    /// the position of the target \[m\].
    pub fn command(&self) -> [f64; 3] {
        self.episode.trial.command()
    }

    /// Applies an action for one policy step. After the end of an episode, call [`reset`](Self::reset) before
    /// the next step.
    ///
    /// # Panics
    ///
    /// If the length of the action differs from the length of the task's actions.
    pub fn step(&mut self, action: &[f32]) -> Step {
        self.episode.advance(&self.stage, &mut self.simulation, action)
    }
}
