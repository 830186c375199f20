//! Strict priorities: a level of tasks never changes the solution of the levels above.
//!
//! Each level minimises its own cost over the motions that leave all levels above unchanged, within the same
//! limits. This is the lexicographic optimum; the thesis's hard stack of tasks is the special case without
//! active limits. Kanoun, Lamiraux and Wieber, *Kinematic control of redundant manipulators: generalizing the
//! task-priority framework to inequality task*, 2011.

mod freedom;
mod level;

pub(crate) use freedom::Freedom;
pub use freedom::Rows;
pub(crate) use level::{Level, LevelError, LevelSolver};
