//! Motion of an end effector through a sequence of poses.

mod path_deviation;
mod pose_reach;
mod segment;
mod shape;
mod speed;

pub use path_deviation::PathDeviation;
pub use pose_reach::{PoseReach, ReachPhase};
pub use segment::{ReachError, Repeat, Segment, SteerError};
pub use shape::{MAX_APEX, PathShape, ShapeError};
pub use speed::SPEED_SLEW;
