//! Components: the controller `control.qp` and the planner, wheel and multirotor controllers.

mod acceleration_limit;
mod centre_of_mass_limit;
mod checks;
mod collision_limits;
mod config;
mod conflicts;
mod controller;
mod diagnostics_output;
mod dynamics_config;
mod figures;
mod formulation;
mod frame_limits;
mod limits_config;
mod measured;
mod mpc;
mod multirotor;
mod objects;
mod setup;
mod support_limits;
mod tasks;
mod wheels;

pub use acceleration_limit::AccelerationConfig;
pub use centre_of_mass_limit::CentreOfMassLimitConfig;
pub use collision_limits::{AllObjects, CollisionConfig, LevelGround, OfWorld, WorldObjects};
pub use config::{Feedback, LevelConfig, QpControllerConfig};
pub use controller::QpController;
pub use dynamics_config::{ContactConfig, InfeasiblePolicy, InverseDynamicsConfig, WrenchConfig};
pub use frame_limits::FrameLimitConfig;
pub use limits_config::LimitsConfig;
pub use mpc::{
    FittedConfig, GaitConfig, GroundConfig, HorizonConfig, LandingConfig, MpcConfig, MpcPlanner,
    WeightsConfig,
};
pub use multirotor::{MultirotorConfig, MultirotorController};
pub use support_limits::{SupportConfig, SupportedPoint};
pub use tasks::*;
pub use wheels::{StartConfig, WheelController, WheelsConfig};

use motorium::prelude::*;
use motorium::worker::Kind;

/// Period of a step, ns.
fn period_ns(tick: &Tick) -> u64 {
    u64::try_from(tick.period.as_nanos()).unwrap_or(u64::MAX)
}

/// Returns the component kinds of this crate, for a host program.
///
/// ```
/// let names: Vec<_> = motorium_control::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"control.qp"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 4] {
    [
        Kind::of::<QpController>(),
        Kind::of::<MpcPlanner>(),
        Kind::of::<WheelController>(),
        Kind::of::<MultirotorController>(),
    ]
}
