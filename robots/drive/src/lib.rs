//! The setpoint of one joint, as passed from the command gate to the drive.
//!
//! The gate checks and bounds a [`JointSetpoint`]; simulated and real drives follow it. All of them share one
//! type, one impedance law and one braking law. The functions bound a setpoint's range ([`within_range`]) and
//! its rate of change ([`within_rate`]); the gate and the training environments share them.

mod acceleration;
mod limits;
mod setpoint;

pub use acceleration::{ACCELERATION_BAND, STOPPING_SHARE};
pub use limits::{RANGE_TOLERANCE, ROUNDING, within_range, within_rate};
pub use setpoint::{BRAKING_BAND, JointSetpoint};
