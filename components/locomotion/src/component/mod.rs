//! The components `control.mpc`, `control.wheels` and `control.multirotor`.

mod mpc;
mod multirotor;
mod wheels;

pub use mpc::{
    FittedConfig, GaitConfig, GroundConfig, HorizonConfig, LandingConfig, MpcConfig, MpcPlanner,
    WeightsConfig,
};
pub use multirotor::{MultirotorConfig, MultirotorController};
pub use wheels::WheelController;

pub use crate::wheels::{StartConfig, WheelsConfig};

use motorium::worker::Kind;

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_locomotion::kinds().iter().map(|kind| kind.name).collect();
/// assert_eq!(names, ["control.mpc", "control.wheels", "control.multirotor"]);
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 3] {
    [Kind::of::<MpcPlanner>(), Kind::of::<WheelController>(), Kind::of::<MultirotorController>()]
}
