//! Limits of the commanded motion: bounds on the joint velocities ([`Limit`]) or on combinations of them ([`RowLimit`]).

mod cartesian_velocity;
mod collision;
mod position;
mod rows;
mod velocity;

pub use cartesian_velocity::CartesianVelocityLimit;
pub use collision::{CollisionLimit, CollisionSettings};
pub use position::PositionLimit;
pub use rows::{LimitRows, RowLimit};
pub use velocity::VelocityLimit;

use crate::{RobotState, solver::Problem};

/// Bounds on the joint velocity `v` \[rad/s or m/s\] that always admit `v = 0`, so that any set of limits has a
/// solution whatever the state.
pub trait Limit {
    /// Intersects the bounds of `problem`, whose unknowns are the joint velocities, with those of this limit for a tick
    /// of `dt` seconds.
    fn intersect(&self, state: &RobotState<'_>, dt: f64, problem: &mut Problem);
}
