//! The setpoint of one joint. motorium's command gate, which checks all commands of a robot, passes it to the
//! drive.
//!
//! The gate checks and bounds a [`JointSetpoint`]; simulated and real drives follow it with the same
//! impedance law and the same braking law. Two functions bound a setpoint to a range ([`within_range`]) and
//! bound its rate of change ([`within_rate`]). The gate and the training environments use both.

mod acceleration;
mod limits;
mod setpoint;

pub use acceleration::{ACCELERATION_BAND, STOPPING_SHARE};
pub use limits::{RANGE_TOLERANCE, ROUNDING, within_range, within_rate};
pub use setpoint::{BRAKING_BAND, JointSetpoint};
