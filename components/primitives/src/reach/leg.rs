//! The legs of a reach, and what cannot be one.

use std::time::Duration;

use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::{PathShape, ShapeError};
use crate::dmp::MoveError;

/// One goal and the way there.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Pose of the hand at the end, in the world frame.
    pub goal: Isometry3<f64>,
    /// Time to get there, at least 1 ms.
    pub duration: Duration,
    /// Time to stay there.
    pub dwell: Duration,
    /// The way of the position.
    pub shape: PathShape,
}

/// What follows the last leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Repeat {
    /// The hand stays at the last goal.
    #[default]
    Once,
    /// The first goal.
    Forever,
}

/// Why a sequence of legs is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReachError {
    /// Nowhere to go.
    #[error("no goal given, expected at least one")]
    NoLegs,
    /// A goal that is no pose.
    #[error("the pose of goal {leg} holds numbers that are not finite")]
    Goal {
        /// Which one, from 0.
        leg: usize,
    },
    /// Too little time.
    #[error("goal {leg} is to be reached in {found:?}, expected at least 1 ms")]
    Duration {
        /// Which one, from 0.
        leg: usize,
        /// What was found.
        found: Duration,
    },
    /// A shape that leads nowhere.
    #[error("the way to goal {leg}: {source}")]
    Shape {
        /// Which one, from 0.
        leg: usize,
        /// Why.
        source: ShapeError,
    },
}

/// Why a hand cannot be started or steered. What ran before goes on unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SteerError {
    /// Steered before it was started.
    #[error("the reach has not been started, so it has no pose to be steered from")]
    NotStarted,
    /// A leg that does not exist.
    #[error("there is no leg {leg}: there are {legs}, counted from 0")]
    NoSuchLeg {
        /// What was asked for.
        leg: usize,
        /// How many there are.
        legs: usize,
    },
    /// A speed that cannot be run.
    #[error("a speed factor of {found}, expected a finite number of at least 0")]
    Speed {
        /// What was found.
        found: f64,
    },
    /// Another shape for a leg that is under way.
    #[error("leg {leg} is under way: its shape can change when the hand has arrived")]
    UnderWay {
        /// Which one, from 0.
        leg: usize,
    },
    /// What the primitives refused.
    #[error(transparent)]
    Move(#[from] MoveError),
}

/// The shortest time a leg may take.
const SHORTEST: Duration = Duration::from_millis(1);

impl Leg {
    /// Checks what does not depend on the shape. `index` is the number of the leg, from 0.
    pub(super) fn check(&self, index: usize) -> Result<(), ReachError> {
        if !numbers(&self.goal).all(f64::is_finite) {
            return Err(ReachError::Goal { leg: index });
        }
        if self.duration < SHORTEST {
            return Err(ReachError::Duration { leg: index, found: self.duration });
        }
        Ok(())
    }
}

/// The numbers a pose is made of.
pub(super) fn numbers(pose: &Isometry3<f64>) -> impl Iterator<Item = f64> + '_ {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied()
}
