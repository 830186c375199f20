//! The segments of a reach, and their errors.

use std::time::Duration;

use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::{PathShape, ShapeError};
use crate::dmp::MoveError;

/// One goal and the path to this goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Goal pose of the end effector in the world frame.
    pub goal: Isometry3<f64>,
    /// Time to reach the goal, at least 1 ms.
    pub duration: Duration,
    /// Dwell time at the goal.
    pub dwell: Duration,
    /// Shape of the position path.
    pub shape: PathShape,
}

/// Behaviour after the last segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Repeat {
    /// The end effector stays at the last goal.
    #[default]
    Once,
    /// The end effector returns to the first goal.
    Forever,
}

/// Error returned when a sequence of segments is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReachError {
    /// There is no goal.
    #[error("no goal given, expected at least one")]
    NoSegments,
    /// The goal is not a finite pose.
    #[error("the pose of goal {segment} contains numbers that are not finite")]
    Goal {
        /// Index of the goal, from 0.
        segment: usize,
    },
    /// The duration is too short.
    #[error("goal {segment} has a duration of {} s, expected at least 0.001 s", .found.as_secs_f64())]
    Duration {
        /// Index of the goal, from 0.
        segment: usize,
        /// Duration found.
        found: Duration,
    },
    /// The shape of a path is invalid.
    #[error("the path to goal {segment}: {source}")]
    Shape {
        /// Index of the goal, from 0.
        segment: usize,
        /// Reason why the shape is invalid.
        source: ShapeError,
    },
}

/// Error returned when a reach cannot be started or steered. The reach is left unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SteerError {
    /// The reach was steered before it was started.
    #[error("the reach has not been started, so it has no pose yet")]
    NotStarted,
    /// The segment does not exist.
    #[error("there is no segment {segment}, expected an index below {segments}")]
    NoSuchSegment {
        /// Index requested.
        segment: usize,
        /// Number of segments.
        segments: usize,
    },
    /// The speed factor is invalid.
    #[error("the speed factor is {found}, expected a finite number of at least 0")]
    Speed {
        /// Speed factor found.
        found: f64,
    },
    /// The shape of a segment in progress cannot change.
    #[error("segment {segment} is in progress: change its shape after the end effector has arrived")]
    UnderWay {
        /// Index of the segment, from 0.
        segment: usize,
    },
    /// A primitive rejected the command.
    #[error(transparent)]
    Move(#[from] MoveError),
}

/// Shortest duration of a segment.
const SHORTEST: Duration = Duration::from_millis(1);

impl Segment {
    /// Checks everything except the shape. `index` is the number of the segment, from 0.
    pub(super) fn check(&self, index: usize) -> Result<(), ReachError> {
        if !numbers(&self.goal).all(f64::is_finite) {
            return Err(ReachError::Goal { segment: index });
        }
        if self.duration < SHORTEST {
            return Err(ReachError::Duration { segment: index, found: self.duration });
        }
        Ok(())
    }
}

/// Components of a pose.
pub(super) fn numbers(pose: &Isometry3<f64>) -> impl Iterator<Item = f64> + '_ {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied()
}
