//! Topics and parameters over iceoryx2: made by the launcher, only opened by components.
//!
//! [`Domain`] keeps runs apart, [`Shared`] is the choice of mechanisms, [`Input`] and [`Output`] are the ports a
//! component steps with, [`Observer`] is how tools look on without taking part.

mod bell;
mod domain;
mod eager;
mod exchange;
mod input;
mod observer;
mod output;
mod parameter;
mod pooled;
#[cfg(test)]
mod tests;
mod topic;
mod trigger;
mod variant;

pub(crate) use bell::LateBell;
pub use domain::{Domain, DomainError};
pub use exchange::{Exchange, ExchangeError, Seat};
pub use input::{Input, Reading};
pub use observer::{Observed, Observer};
pub(crate) use output::{Connect, Probe};
pub use output::{Loan, Output};
pub use parameter::{AnyParameter, Parameter, ParameterError, ParameterTable};
pub(crate) use parameter::{ParameterReader, ParameterService};
pub use topic::PortError;
pub(crate) use topic::{TopicService, open_trigger};
pub use trigger::Trigger;
pub(crate) use trigger::Waker;
pub use variant::Shared;

/// Quietens iceoryx2's own log to what its user must know; its errors come back as values anyway.
pub fn quieten() {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
}
