//! The robot of a task and its simulation.

use std::path::Path;

use motorium_models::policy::RobotDigest;
use motorium_physics::{ArticulatedSimulator, BuildError, Options, RobotSetup};
use motorium_robots::{LoadError, ModelWarning, UnknownFrame, load};
use motorium_worlds::{World, WorldError};

use crate::task::{Task, digest_joints, robot_digest};

/// A robot that cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// Its file or its profile is invalid.
    #[error("`robot`: \"{robot}\": {source}")]
    Load {
        /// The robot of the task.
        robot: String,
        /// Reason.
        source: Box<LoadError>,
    },
    /// Its profile names a frame that it does not have.
    #[error("`robot`: \"{robot}\": {source}")]
    Frame {
        /// The robot of the task.
        robot: String,
        /// Reason.
        source: UnknownFrame,
    },
    /// Its world is invalid.
    #[error("`world`: {0}")]
    World(#[from] WorldError),
}

/// The robot of a task in its world.
#[derive(Clone, Debug)]
pub struct Scene {
    robot: RobotSetup,
    world: World,
    warnings: Vec<ModelWarning>,
    digest: Option<RobotDigest>,
    start: Vec<f64>,
}

impl Scene {
    /// Loads the robot of a task; files are relative to `base`.
    ///
    /// # Errors
    ///
    /// [`SceneError`].
    pub fn load(task: &Task, base: &Path) -> Result<Self, SceneError> {
        let robot = || task.robot.clone();
        let loaded = load(&task.robot, base)
            .map_err(|source| SceneError::Load { robot: robot(), source: Box::new(source) })?;
        let setup = RobotSetup::from_loaded(&loaded)
            .map_err(|source| SceneError::Frame { robot: robot(), source })?;
        let mut world = task.world.clone();
        let warnings = world.locate(base)?;
        let policy = task.policy().ok();
        let digest = policy.and_then(|policy| robot_digest(&loaded, &digest_joints(&policy.action, &loaded)));
        Ok(Self { robot: setup, world, warnings, digest, start: task.start.position.clone() })
    }

    /// Warnings of elements of the world's file that are left out.
    pub fn warnings(&self) -> &[ModelWarning] {
        &self.warnings
    }

    /// Digest of the robot for the policies of the task; `None` if it lacks a joint of the action.
    pub fn robot_digest(&self) -> Option<RobotDigest> {
        self.digest
    }

    /// Builds a simulation of the robot.
    ///
    /// # Errors
    ///
    /// [`BuildError`].
    pub fn simulation(&self) -> Result<ArticulatedSimulator, BuildError> {
        ArticulatedSimulator::new(self.robot.clone(), self.world.clone(), &self.start, Options::default())
    }
}
