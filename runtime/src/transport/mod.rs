//! Topics and parameters over iceoryx2: made by the launcher, only opened by components.
//!
//! Small states go from component to component through the slots of their topic (`slots`), and are echoed over iceoryx2
//! for everybody else (`echo`); streams and large states are iceoryx2 samples, read in place.
//!
//! [`Domain`] keeps runs apart, [`Shared`] is the choice of mechanisms, [`Input`] and [`Output`] are the ports a
//! component steps with, [`Observer`] is how tools look on without taking part.

mod bell;
mod context;
mod domain;
mod eager;
mod echo;
mod input;
mod observer;
mod output;
mod parameter;
mod pooled;
mod slots;
#[cfg(test)]
mod tests;
mod topic;
mod trigger;
mod variant;

pub(crate) use bell::Bell;
pub use context::Context;
pub(crate) use context::{AfterStep, Signals};
pub use domain::{Domain, DomainError};
pub use input::{Input, Reading};
pub use observer::{Observed, Observer};
pub(crate) use output::{Connect, Probe};
pub use output::{Loan, Output};
pub use parameter::{AnyParameter, Parameter, ParameterError, ParameterTable};
pub(crate) use parameter::{ParameterReader, ParameterService};
pub use topic::PortError;
pub(crate) use topic::{TopicService, open_trigger};
pub use trigger::Trigger;
pub(crate) use trigger::{LOOK_NS, Waker, open_bell};
pub use variant::Shared;

/// Quietens iceoryx2's own log to what its user must know; its errors come back as values anyway.
pub fn quieten() {
    iceoryx2::prelude::set_log_level(iceoryx2::prelude::LogLevel::Fatal);
}
