//! Components: the controller `control.qp` and the planner, wheel and multirotor controllers.

mod config;
mod conflicts;
mod controller;
mod diagnostics_output;
mod dynamics_config;
mod figures;
mod formulation;
mod measured;
mod mpc;
mod multirotor;
mod objects;
mod setup;
mod wheels;

pub use config::{Feedback, LevelConfig, QpControllerConfig};
pub use controller::QpController;
pub use dynamics_config::{ContactConfig, InfeasiblePolicy, InverseDynamicsConfig, WrenchConfig};
pub use mpc::{
    FittedConfig, GaitConfig, GroundConfig, HorizonConfig, LandingConfig, MpcConfig, MpcPlanner,
    WeightsConfig,
};
pub use multirotor::{MultirotorConfig, MultirotorController};
pub use wheels::{StartConfig, WheelController, WheelsConfig};

use motorium::prelude::*;
use motorium::worker::Kind;

/// The robot of a component that needs one.
fn required_robot(declare: &Declare) -> Result<&RobotReference, ConfigError> {
    declare.robot().ok_or_else(|| {
        ConfigError::new("the component names no robot, but needs one")
            .advise("add `robot = \"NAME\"` to the component")
    })
}

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
