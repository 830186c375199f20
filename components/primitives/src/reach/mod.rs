//! A hand led through a sequence of poses.

mod leg;
mod path_deviation;
mod pose_reach;
mod shape;
mod speed;

pub use leg::{Leg, ReachError, Repeat, SteerError};
pub use path_deviation::PathDeviation;
pub use pose_reach::{PoseReach, ReachPhase};
pub use shape::{MAX_APEX, PathShape, ShapeError};
pub use speed::SPEED_SLEW;
