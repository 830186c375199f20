//! The setpoint of one joint on its way from the command gate to its drive.
//!
//! The gate checks and bounds a [`JointSetpoint`], and simulated and real drives follow it: one type, one
//! impedance law and one braking law for all of them. The functions bound a setpoint's range
//! ([`within_range`]) and its rate of change ([`within_rate`]); the gate and the training environments share
//! them.

mod acceleration;
mod limits;
mod setpoint;

pub use acceleration::{ACCELERATION_BAND, STOPPING_SHARE};
pub use limits::{RANGE_TOLERANCE, ROUNDING, within_range, within_rate};
pub use setpoint::{BRAKING_BAND, JointSetpoint};
