//! Strict priorities: what one level of tasks decides, no level below it changes.
//!
//! Each level minimises its own cost over the motions that leave all levels above as they are, within the
//! same limits: the lexicographic optimum, of which the thesis's hard stack of tasks is the case without
//! active limits. Kanoun, Lamiraux and Wieber, *Kinematic control of redundant manipulators: generalizing the
//! task-priority framework to inequality task*, 2011.

mod freedom;
mod level;

pub(crate) use freedom::Freedom;
pub use freedom::Rows;
pub(crate) use level::{Level, LevelSolver};
