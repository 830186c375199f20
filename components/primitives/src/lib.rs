//! Models of movements, which are constructed, started and then stepped in a control loop. Only construction
//! allocates. The crate does not depend on the runtime.
//!
//! - [`dmp`]: dynamic movement primitives: discrete, rhythmic, with a final velocity, and for orientations.
//! - [`promp`]: probabilistic movement primitives.
//! - [`kmp`]: kernelised movement primitives.
//! - [`gmm`]: Gaussian mixtures and regression with them.
//! - [`cpg`]: central pattern generators and gaits.
//! - [`regression`]: linear and polynomial policies and movements.
//! - [`mean`]: execution of the mean of probabilistic, kernelised and polynomial movements.
//! - [`reach`]: motion of an end effector through a sequence of poses by dynamic movement primitives.
//! - [`profile`]: motion from rest to rest within limits of velocity, acceleration and jerk.
//! - [`route`]: motion of a mobile base through planar poses.
//! - [`rollout`]: evenly spaced samples of a primitive's movement.
//! - [`file`]: storage of primitives in files.
//!
//! ```
//! use std::time::Duration;
//! use motorium_primitives::reach::{Segment, PathShape, PoseReach, ReachPhase, Repeat};
//! use nalgebra::{Isometry3, Vector3};
//!
//! let segment = Segment {
//!     goal: Isometry3::translation(0.5, 0.2, 0.4),
//!     duration: Duration::from_secs(2),
//!     dwell: Duration::from_millis(500),
//!     shape: PathShape::Arc { apex: Vector3::new(0.0, 0.0, 0.1) },
//! };
//! let mut reach = PoseReach::new(vec![segment], Repeat::Once)?;
//! reach.start(Isometry3::translation(0.3, 0.0, 0.5))?;
//! while reach.phase() != ReachPhase::Finished {
//!     reach.step(Duration::from_millis(1));
//! }
//! assert!((reach.pose().translation.vector - Vector3::new(0.5, 0.2, 0.4)).norm() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod cpg;
pub mod dmp;
pub mod file;
pub mod gmm;
pub mod kmp;
pub mod mean;
pub mod profile;
pub mod promp;
pub mod reach;
pub mod regression;
pub mod rollout;
pub mod route;
mod value;

pub use value::ValueError;
