//! The component `control.qp`.

mod config;
mod conflicts;
mod controller;
mod diagnostics_output;
mod dynamics_config;
mod figures;
mod fingers;
mod formulation;
pub mod measured;
mod objects;
mod setup;

pub use config::{Feedback, LevelConfig, QpControllerConfig};
pub use controller::QpController;
pub use dynamics_config::{ContactConfig, InfeasiblePolicy, InverseDynamicsConfig, WrenchConfig};

use motorium::worker::Kind;

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_control::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"control.qp"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 1] {
    [Kind::of::<QpController>()]
}
