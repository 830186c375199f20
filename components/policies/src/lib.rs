//! Policies: components that move a robot by movement primitives, motion libraries, latent spaces and pattern
//! generators.
//!
//! | module | component | moves |
//! |---|---|---|
//! | [`dmp`] | `policy.dmp`, [`DmpPolicy`] | an end effector through poses, by dynamic movement primitives |
//! | [`latent`] | `policy.latent`, [`LatentPolicy`] | joints of several robots that imitate a human |
//! | [`library`] | `policy.library`, [`LibraryPolicy`] | an end effector in a plane or joints, by a library |
//! | [`promp`] | `policy.promp`, [`ProMpPolicy`] | joints, by a probabilistic movement primitive |
//! | [`cpg`] | `policy.cpg`, [`CpgPolicy`] | joints of legs in a gait, by a central pattern generator |
//! | [`trajectory`] | `policy.trajectory`, [`TrajectoryPolicy`] | joints through waypoints, within limits |
//! | [`trajectory`] | `policy.home`, [`HomePolicy`] | joints to the home pose |
//! | [`network`] | `policy.network`, [`NetworkPolicy`] | publishes the actions of a trained network |
//! | [`joint_targets`] | `policy.joint_targets`, [`JointTargetsPolicy`] | joints by the actions of a policy |
//! | [`waypoints`] | `policy.waypoints`, [`WaypointsPolicy`] | a wheeled base through planar poses |
//!
//! The underlying models are plain libraries that do not need the runtime: `motorium_primitives`,
//! `motorium_library` and `motorium_models`.
//!
//! A program that hosts these components registers their kinds, as the `motorium` command does. It can query
//! their ports without running anything:
//!
//! ```
//! use motorium::worker::Kind;
//! use motorium_policies::DmpPolicy;
//!
//! let config = serde_json::json!({
//!     "start": { "position": [0.4, 0.0, 0.4] },
//!     "goals": [{ "position": [0.5, 0.2, 0.4], "duration": "2 s" }],
//! });
//! let declared = Kind::of::<DmpPolicy>().declare(config, None).unwrap();
//! assert_eq!(declared.ports[0].name, "target");
//! ```

pub mod cpg;
pub mod dmp;
mod gripper;
mod joint_command;
pub mod joint_targets;
pub mod latent;
pub mod library;
mod motion_limits;
pub mod network;
pub mod promp;
mod reach;
mod robot;
mod text_or_table;
pub mod trajectory;
pub mod waypoints;

use motorium::worker::Kind;

pub use cpg::CpgPolicy;
pub use dmp::DmpPolicy;
pub use gripper::{Fingers, Gripper, GripperEnd, GripperError, GripperTextError};
pub use joint_command::JointCommandConfig;
pub use joint_targets::JointTargetsPolicy;
pub use latent::LatentPolicy;
pub use library::LibraryPolicy;
pub use motion_limits::MotionLimitsConfig;
pub use network::NetworkPolicy;
pub use promp::ProMpPolicy;
pub use trajectory::{HomePolicy, TrajectoryPolicy};
pub use waypoints::WaypointsPolicy;

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_policies::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"policy.dmp"));
/// ```
// Not inlined, as `Kind::of` requires.
#[inline(never)]
pub fn kinds() -> [Kind; 10] {
    [
        Kind::of::<CpgPolicy>(),
        Kind::of::<DmpPolicy>(),
        Kind::of::<ProMpPolicy>(),
        Kind::of::<LatentPolicy>(),
        Kind::of::<LibraryPolicy>(),
        Kind::of::<NetworkPolicy>(),
        Kind::of::<JointTargetsPolicy>(),
        Kind::of::<WaypointsPolicy>(),
        Kind::of::<TrajectoryPolicy>(),
        Kind::of::<HomePolicy>(),
    ]
}
