//! The command gate: the last check of every command before an actuator applies it, and the safe states it
//! applies instead.
//!
//! # Layers
//!
//! [`Gate`] is the logic, a state machine over the joints without ports or clocks; [`Freshness`] and
//! [`SuspendClock`] decide on stamps; [`enter`] and [`stay`] are the law of the safe states; [`CommandGate`]
//! joins them to the input of an actuator, to the run's latch and to the account in the control block. An
//! actuator uses [`CommandGate`] alone.
//!
//! # Order of the checks
//!
//! 1. The run: stopping, latched, stopped in an emergency?
//! 2. The stamp: order, future, age by publication and by source.
//! 3. The content: finite, the right count, gains that are not negative.
//! 4. The limits: position, velocity, effort, gains, rates of change.
//!
//! A command that fails 1 to 3 is not applied: the safe state is. One that fails 4 is clamped, or refused
//! where the graph says `limits = "refuse"`.

mod account;
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
