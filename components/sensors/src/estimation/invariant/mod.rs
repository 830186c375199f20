//! The contact-aided invariant extended Kalman filter of a legged base.

mod blocks;
mod filter;
mod noise;

pub use filter::{ContactKinematics, FilterState, InvariantFilter};
pub use noise::{FilterNoise, StartDeviations};
