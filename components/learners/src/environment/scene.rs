//! The robot of a task and its simulation.

use std::path::Path;

use motorium_physics::{ArticulatedSimulator, BuildError, Options, World};
use motorium_robots::{LoadError, Model, load};

use crate::task::Task;

/// A robot that cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[error("`robot`: \"{robot}\": {source}")]
pub struct SceneError {
    /// The robot of the task.
    pub robot: String,
    /// Reason.
    pub source: Box<LoadError>,
}

/// The robot of a task on the ground of an empty world.
#[derive(Clone, Debug)]
pub struct Scene {
    model: Model,
    start: Vec<f64>,
}

impl Scene {
    /// Loads the robot of a task; files are relative to `base`.
    ///
    /// # Errors
    ///
    /// [`SceneError`].
    pub fn load(task: &Task, base: &Path) -> Result<Self, SceneError> {
        let loaded = load(&task.robot, base)
            .map_err(|source| SceneError { robot: task.robot.clone(), source: Box::new(source) })?;
        Ok(Self { model: loaded.model, start: task.start.position.clone() })
    }

    /// Builds a simulation of the robot.
    ///
    /// # Errors
    ///
    /// [`BuildError`].
    pub fn simulation(&self) -> Result<ArticulatedSimulator, BuildError> {
        ArticulatedSimulator::new(self.model.clone(), World::default(), &self.start, Options::default())
    }
}
