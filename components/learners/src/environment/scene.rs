//! The robot of a task and its simulation.

use std::path::Path;

use motorium_models::policy::RobotDigest;
use motorium_physics::{ArticulatedSimulator, BuildError, Options, RobotSetup};
use motorium_robots::{LoadError, ModelWarning, UnknownFrame, load};
use motorium_worlds::{World, WorldError};

use crate::task::{Task, digest_joints, robot_digest};

/// Error of loading the robot or the world of a task.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file or the profile of the robot is invalid.
    #[error("`robot`: \"{robot}\": {source}")]
    Load {
        /// Robot as named in the task.
        robot: String,
        /// Reason why loading failed.
        source: Box<LoadError>,
    },
    /// The profile of the robot refers to a frame that the robot lacks.
    #[error("`robot`: \"{robot}\": {source}")]
    Frame {
        /// Robot as named in the task.
        robot: String,
        /// Description of the unknown frame.
        source: UnknownFrame,
    },
    /// The world of the task is invalid.
    #[error("`world`: {0}")]
    World(#[from] WorldError),
}

/// The robot and the world of a task, from which simulations are built.
#[derive(Clone, Debug)]
pub struct Scene {
    robot: RobotSetup,
    world: World,
    warnings: Vec<ModelWarning>,
    digest: Option<RobotDigest>,
    start: Vec<f64>,
}

impl Scene {
    /// Loads the robot and the world of a task. Paths in the task are relative to `base`.
    ///
    /// # Errors
    ///
    /// [`SceneError`] if the robot or the world cannot be loaded.
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

    /// Returns warnings about ignored elements of the world's file.
    pub fn warnings(&self) -> &[ModelWarning] {
        &self.warnings
    }

    /// Returns the digest of the robot for policies of the task; `None` if the robot lacks a joint of the
    /// action.
    pub fn robot_digest(&self) -> Option<RobotDigest> {
        self.digest
    }

    /// Builds a simulation of the robot.
    ///
    /// # Errors
    ///
    /// [`BuildError`] if the robot or the world cannot be simulated.
    pub fn simulation(&self) -> Result<ArticulatedSimulator, BuildError> {
        ArticulatedSimulator::new(self.robot.clone(), self.world.clone(), &self.start, Options::default())
    }
}
