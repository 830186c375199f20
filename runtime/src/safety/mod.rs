//! The command gate: the last check of every command before an actuator applies it, and the safe states that
//! an actuator applies without a valid command.
//!
//! # Layers
//!
//! [`Gate`] is the logic, a state machine over the joints without ports or clocks. [`Freshness`] and
//! [`SuspendClock`] check stamps. [`enter`] and [`stay`] are the control laws of the safe states.
//! [`CommandGate`] connects these parts to the input of an actuator, to the run's latch and to the statistics
//! in the control block. An actuator only uses [`CommandGate`].
//!
//! # Order of the checks
//!
//! 1. The run: stopping, latched, stopped in an emergency?
//! 2. The stamp: order, future, age by publication and by source.
//! 3. The content: finite, the right count, gains that are not negative.
//! 4. The limits: position, velocity, effort, gains, rates of change.
//!
//! If a command fails checks 1 to 3, the actuator applies the safe state instead of the command. A command
//! that fails check 4 is clamped, or refused if the graph sets `limits = "refuse"`.

mod account;
mod arrival;
mod emergency;
mod freshness;
mod gate;
mod group;
mod limits;
mod offer;
mod port;
mod rest;
mod resume;
mod states;
#[cfg(test)]
mod tests;
mod within;

pub use account::Account;
pub use freshness::{Age, Freshness, SuspendClock};
pub use gate::Gate;
pub use limits::JointLimits;
pub use motorium_drive::JointSetpoint;
pub use offer::{Measured, Offer, Verdict};
pub use port::CommandGate;
pub use rest::{REST_SPEED, REST_WITHIN};
pub use resume::RESUME_WITHIN;
pub use states::{Joint, enter, stay};
