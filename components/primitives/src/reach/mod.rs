//! A hand led through a sequence of poses.

mod leg;
mod pose_reach;
mod shape;
mod speed;
mod twist;

pub use leg::{Leg, ReachError, Repeat, SteerError};
pub use pose_reach::{PoseReach, ReachPhase};
pub use shape::{PathShape, ShapeError};
pub use speed::SPEED_SLEW;
pub use twist::Twist;
