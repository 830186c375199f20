//! Limits of the commanded motion: bounds on the joint velocities ([`Limit`]) or on combinations of them
//! ([`RowLimit`]).

mod acceleration;
mod cartesian_position;
mod cartesian_velocity;
mod centre_of_mass_velocity;
mod collision;
mod config;
mod frames;
mod position;
mod rows;
mod support;
mod velocity;

pub use acceleration::{AccelerationConfig, AccelerationLimit};
pub use cartesian_position::CartesianPositionLimit;
pub use cartesian_velocity::CartesianVelocityLimit;
pub use centre_of_mass_velocity::{CentreOfMassLimitConfig, CentreOfMassVelocityLimit};
pub use collision::{
    AllObjects, CollisionConfig, CollisionLimit, CollisionSettings, LevelGround, OfWorld, WorldObjects,
};
pub use config::LimitsConfig;
pub use frames::FrameLimitConfig;
pub use position::PositionLimit;
pub(crate) use rows::are_alike;
pub use rows::{LimitRows, RowLimit};
pub(crate) use support::HeldSupport;
pub use support::{SupportConfig, SupportLimit, Supported, SupportedPoint};
pub use velocity::VelocityLimit;

use motorium_qp::Problem;

use crate::RobotState;

/// A limit as bounds on the joint velocity `v` \[rad/s or m/s\]. The bounds always admit `v = 0`, so any
/// combination of these limits is feasible in every state.
pub trait Limit {
    /// Narrows the bounds of `problem`, whose unknowns are the joint velocities, to satisfy this limit for a
    /// tick of `dt` seconds.
    fn intersect(&self, state: &RobotState<'_>, dt: f64, problem: &mut Problem);
}
