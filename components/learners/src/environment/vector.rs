//! Many worlds stepped together.

use std::sync::Arc;

use motorium_physics::{Batch, BuildError, Engine, Simulation, Simulator as _};

use super::episode::Episode;
use super::stage::Stage;
use super::{EnvironmentError, Step};
use crate::task::{Task, Terms};

/// Data of a world on the thread that steps it.
struct Data {
    episode: Episode,
    action: Vec<f32>,
    step: Step,
    /// Final observation of an episode that ended in the last step.
    last: Vec<f32>,
    failure: Option<EnvironmentError>,
}

/// The running episode of a world: the data required to replay the episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Number of the episode.
    pub number: u64,
    /// Level of the curriculum at the start of the episode, 0 to 1.
    pub level: f64,
    /// Actions of the episode so far.
    pub actions: Vec<f32>,
}

/// Many worlds of a task, stepped on several threads. When an episode ends, the next episode starts in the
/// same step; the final observation remains available next to the first observation of the new episode.
pub struct VectorEnvironment<E> {
    batch: Batch<E, Data>,
    stage: Arc<Stage>,
    /// Level of the curriculum of the next episodes.
    level: f64,
    observations: Vec<f32>,
    last: Vec<f32>,
    steps: Vec<Step>,
}

impl<E: Engine + Send> VectorEnvironment<E> {
    /// Creates `worlds` worlds, which `threads` threads step. All worlds are at the start of episode 0.
    /// `build` creates the simulation of each world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] if the task does not fit the robot, a simulation cannot be built, or an episode
    /// cannot start.
    pub fn new(
        task: &Task,
        (worlds, threads): (usize, usize),
        seed: u64,
        mut build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        let mut first = build()?;
        let stage = Arc::new(Stage::new(task, &mut first)?);
        let terms = &stage.terms;
        let drives = first.joint_names().len();
        let batch = Batch::new(worlds.max(1), threads, |_| build())?.with_data(|world| Data {
            episode: Episode::new(&stage, seed, world as u64, drives),
            action: vec![0.0; terms.actions()],
            step: Step::default(),
            last: vec![0.0; terms.inputs()],
            failure: None,
        });
        let count = batch.count();
        let level = terms.level(0);
        let mut made = Self {
            batch,
            level,
            observations: vec![0.0; count * terms.inputs()],
            last: vec![0.0; count * terms.inputs()],
            steps: vec![Step::default(); count],
            stage,
        };
        made.resume(seed, &vec![Progress { level, ..Progress::default() }; count])?;
        Ok(made)
    }

    /// Returns the terms of the task.
    pub fn terms(&self) -> &Terms {
        &self.stage.terms
    }

    /// Returns the number of worlds.
    pub fn worlds(&self) -> usize {
        self.batch.count()
    }

    /// Returns the number of threads that step the worlds, including the calling thread.
    pub fn threads(&self) -> usize {
        self.batch.threads()
    }

    /// Calls `work` once on each thread with the index of the thread, and returns when all calls have
    /// returned.
    pub fn on_threads(&mut self, work: &(dyn Fn(usize) + Sync)) {
        self.batch.on_threads(work);
    }

    /// Returns the observations of all worlds, world by world. For a world whose episode has ended, this is
    /// the first observation of the next episode.
    pub fn observations(&self) -> &[f32] {
        &self.observations
    }

    /// Returns the final observation of an episode that ended in the last step, or `None` if the episode
    /// continues.
    pub fn final_observation(&self, world: usize) -> Option<&[f32]> {
        let inputs = self.terms().inputs();
        self.steps[world].end.map(|_| &self.last[world * inputs..][..inputs])
    }

    /// Returns the result of the last step for each world.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Sets the level of the curriculum, 0 to 1, for the following episodes.
    pub fn set_level(&mut self, level: f64) {
        self.level = level;
    }

    /// Returns the running episode of each world, for [`resume`](Self::resume).
    pub fn progress(&self) -> Vec<Progress> {
        let episodes = self.batch.data().iter().map(|data| &data.episode);
        let progress = |episode: &Episode| Progress {
            number: episode.number,
            level: episode.level,
            actions: episode.actions.clone(),
        };
        episodes.map(progress).collect()
    }

    /// Restores the worlds of a run bit for bit. `seed` is the seed of the run. Each world starts the episode
    /// in `progress` and replays the actions of this episode.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`] if an episode cannot start.
    ///
    /// # Panics
    ///
    /// If there are fewer entries than worlds.
    pub fn resume(&mut self, seed: u64, progress: &[Progress]) -> Result<(), EnvironmentError> {
        assert!(progress.len() >= self.worlds(), "an episode for each world");
        let stage = &self.stage;
        self.batch.each(|world, simulation, data| {
            let Progress { number, level, actions } = &progress[world];
            data.step = Step::default();
            data.episode.seed = seed;
            data.failure = data.episode.begin(stage, simulation, (*number, *level, None)).err();
            for action in actions.chunks_exact(stage.terms.actions()) {
                data.episode.advance(stage, simulation, action);
            }
        });
        self.collect()
    }

    /// Ends the running episode of each world and starts the next episode.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`] if an episode cannot start.
    pub fn restart(&mut self) -> Result<(), EnvironmentError> {
        let (stage, level) = (&self.stage, self.level);
        self.batch.each(|_, simulation, data| {
            data.step = Step::default();
            data.failure =
                data.episode.begin(stage, simulation, (data.episode.number + 1, level, None)).err();
        });
        self.collect()
    }

    /// Applies one action per world; `actions` contains the actions of all worlds, world by world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`] if the next episode cannot start.
    ///
    /// # Panics
    ///
    /// If there are fewer actions than worlds need.
    pub fn step(&mut self, actions: &[f32]) -> Result<&[Step], EnvironmentError> {
        let (stage, level) = (&self.stage, self.level);
        let width = stage.terms.actions();
        for (data, action) in self.batch.data_mut().iter_mut().zip(actions.chunks_exact(width)) {
            data.action.copy_from_slice(action);
        }
        self.batch.each(|_, simulation, data| {
            let Data { episode, action, step, last, failure } = data;
            *step = episode.advance(stage, simulation, action);
            if step.end.is_some() {
                last.copy_from_slice(&episode.observation);
                *failure = episode.begin(stage, simulation, (episode.number + 1, level, None)).err();
            }
        });
        self.collect()?;
        Ok(&self.steps)
    }

    /// Applies one action per world and steps physics like [`step`](Self::step), but computes no observations
    /// or rewards, ends no episodes, and does not change pushes. Call [`restart`](Self::restart) before the
    /// next step of the task.
    ///
    /// # Panics
    ///
    /// If there are fewer actions than worlds need.
    pub fn step_physics(&mut self, actions: &[f32]) {
        let stage = &self.stage;
        let width = stage.terms.actions();
        for (data, action) in self.batch.data_mut().iter_mut().zip(actions.chunks_exact(width)) {
            data.action.copy_from_slice(action);
        }
        self.batch.each(|_, simulation, Data { episode, action, .. }| {
            episode.drive(stage, simulation, action);
        });
    }

    /// Copies results of all worlds into contiguous memory.
    fn collect(&mut self) -> Result<(), EnvironmentError> {
        let inputs = self.terms().inputs();
        for (world, data) in self.batch.data_mut().iter_mut().enumerate() {
            if let Some(failure) = data.failure.take() {
                return Err(failure);
            }
            self.steps[world] = data.step;
            self.observations[world * inputs..][..inputs].copy_from_slice(&data.episode.observation);
            if data.step.end.is_some() {
                self.last[world * inputs..][..inputs].copy_from_slice(&data.last);
            }
        }
        Ok(())
    }
}
