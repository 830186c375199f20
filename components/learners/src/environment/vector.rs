//! Many worlds stepped together.

use std::sync::Arc;

use motorium_physics::{Batch, BuildError, Engine, Simulation, Simulator as _};

use super::episode::Episode;
use super::{EnvironmentError, Step};
use crate::task::{Task, Terms};

/// Data of a world on the thread that steps it.
struct Data {
    episode: Episode,
    action: Vec<f32>,
    step: Step,
    /// Observation at the end of an episode that ended in the last step.
    last: Vec<f32>,
    failure: Option<EnvironmentError>,
}

/// Many worlds of a task on several threads. An episode that ends is followed by the next in the same step:
/// its final observation is kept next to the first of the next.
pub struct VectorEnvironment<E> {
    batch: Batch<E, Data>,
    terms: Arc<Terms>,
    observations: Vec<f32>,
    last: Vec<f32>,
    steps: Vec<Step>,
}

impl<E: Engine + Send> VectorEnvironment<E> {
    /// `worlds` worlds on `threads` threads, each at the start of its episode 0. `build` makes the simulation
    /// of a world.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`].
    pub fn new(
        task: &Task,
        (worlds, threads): (usize, usize),
        seed: u64,
        mut build: impl FnMut() -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, EnvironmentError> {
        let mut first = build()?;
        let terms = Arc::new(Terms::new(task, &mut first)?);
        let drives = first.joint_names().len();
        let batch = Batch::new(worlds.max(1), threads, |_| build())?.with_data(|world| Data {
            episode: Episode::new(&terms, seed, world as u64, drives),
            action: vec![0.0; terms.actions()],
            step: Step::default(),
            last: vec![0.0; terms.inputs()],
            failure: None,
        });
        let count = batch.count();
        let mut made = Self {
            batch,
            observations: vec![0.0; count * terms.inputs()],
            last: vec![0.0; count * terms.inputs()],
            steps: vec![Step::default(); count],
            terms,
        };
        made.resume(seed, &vec![(0, vec![]); count])?;
        Ok(made)
    }

    /// The terms of the task.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Number of worlds.
    pub fn worlds(&self) -> usize {
        self.batch.count()
    }

    /// Observations of all worlds, one after the other; after an end the first of the next episode.
    pub fn observations(&self) -> &[f32] {
        &self.observations
    }

    /// The observation at the end of an episode that ended in the last step, or `None` where the episode
    /// continues.
    pub fn final_observation(&self, world: usize) -> Option<&[f32]> {
        let inputs = self.terms.inputs();
        self.steps[world].end.map(|_| &self.last[world * inputs..][..inputs])
    }

    /// Results of the last step, one a world.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Number of the running episode of each world, and its actions so far: all that [`resume`](Self::resume)
    /// needs.
    pub fn progress(&self) -> Vec<(u64, Vec<f32>)> {
        self.batch.data().iter().map(|data| (data.episode.number, data.episode.actions.clone())).collect()
    }

    /// Starts the given episode of each world of a run with a seed and replays its actions: the worlds are
    /// then as they were to the bit.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`].
    ///
    /// # Panics
    ///
    /// If there are fewer entries than worlds.
    pub fn resume(&mut self, seed: u64, progress: &[(u64, Vec<f32>)]) -> Result<(), EnvironmentError> {
        assert!(progress.len() >= self.worlds(), "an episode for each world");
        let terms = &self.terms;
        self.batch.each(|world, simulation, data| {
            let (number, actions) = &progress[world];
            data.step = Step::default();
            data.episode.seed = seed;
            data.failure = data.episode.begin(terms, simulation, *number).err();
            for action in actions.chunks_exact(terms.actions()) {
                data.episode.advance(terms, simulation, action);
            }
        });
        self.collect()
    }

    /// Ends the running episode of each world and starts the next.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`].
    pub fn restart(&mut self) -> Result<(), EnvironmentError> {
        let terms = &self.terms;
        self.batch.each(|_, simulation, data| {
            data.step = Step::default();
            data.failure = data.episode.begin(terms, simulation, data.episode.number + 1).err();
        });
        self.collect()
    }

    /// Applies one action a world, one after the other.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError::Reset`] where the next episode cannot start.
    ///
    /// # Panics
    ///
    /// If there are fewer actions than worlds need.
    pub fn step(&mut self, actions: &[f32]) -> Result<&[Step], EnvironmentError> {
        let terms = &self.terms;
        let width = terms.actions();
        for (data, action) in self.batch.data_mut().iter_mut().zip(actions.chunks_exact(width)) {
            data.action.copy_from_slice(action);
        }
        self.batch.each(|_, simulation, data| {
            let Data { episode, action, step, last, failure } = data;
            *step = episode.advance(terms, simulation, action);
            if step.end.is_some() {
                last.copy_from_slice(&episode.observation);
                *failure = episode.begin(terms, simulation, episode.number + 1).err();
            }
        });
        self.collect()?;
        Ok(&self.steps)
    }

    /// Copies results of all worlds into contiguous memory.
    fn collect(&mut self) -> Result<(), EnvironmentError> {
        let inputs = self.terms.inputs();
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
