//! Environments that simulate a [`Task`](crate::task::Task), independent of the runtime.
//!
//! [`Environment`] is one world, [`VectorEnvironment`] steps many worlds on several threads. The two types
//! run the same code and give bit-for-bit equal results: the random numbers of an episode depend only on the
//! seed, the index of the world and the number of the episode.

mod episode;
mod eyes;
mod scene;
mod stage;
mod vector;

pub use episode::{Environment, EpisodeSummary};
pub use scene::{Scene, SceneError};
pub use vector::{Progress, VectorEnvironment};

use motorium_physics::{BuildError, ResetError, StepError};

use crate::task::TaskError;
pub use crate::task::{End, Step};

/// Error of creating or running an environment.
#[derive(Debug, thiserror::Error)]
pub enum EnvironmentError {
    /// The task does not fit the robot.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The simulation cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The start state of an episode is invalid.
    #[error("world {world}, episode {episode}: {source}")]
    Reset {
        /// Index of the world.
        world: u64,
        /// Number of the episode.
        episode: u64,
        /// Reason why the episode cannot start.
        source: ResetError,
    },
    /// A physics step failed before the first observation.
    #[error("world {world}, episode {episode}, before the first observation: {source}")]
    FreeStep {
        /// Index of the world.
        world: u64,
        /// Number of the episode.
        episode: u64,
        /// Reason why the physics step failed.
        source: StepError,
    },
}

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;
