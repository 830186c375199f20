//! Topics and parameters in shared memory, created by the launcher and opened by components.
//!
//! | pattern | reader | mechanism |
//! |---|---|---|
//! | state | the newest value, in place, of any size | pinned slots ([`latest`]) in iceoryx2 memory |
//! | stream | every value in order, losses counted | a queue per reader ([`stream`]) of iceoryx2 |
//! | parameter | a typed value, taken between two steps | iceoryx2 blackboard |
//!
//! [`Input`] and [`Output`] are the ports that a component uses in its steps, [`Trigger`] waits for a topic,
//! and [`Tap`] reads every value from outside the graph. Ports for types that are only known at run time are
//! in [`raw`](crate::raw). Each run has its own [`Domain`], in which every topic is a service that `iox2`
//! lists.

mod error;
mod input;
mod input_place;
pub(crate) mod latest;
mod layout;
mod output;
mod participant;
mod publication;
pub(crate) mod stream;
mod tap;
#[cfg(test)]
pub(crate) mod tests;
mod topic;
mod trigger;

pub use crate::domain::{Domain, DomainError, SHARED_MEMORY, ServiceError, Shared, quieten};
pub use crate::parameter::{AnyParameter, Choice, Parameter, ParameterArray, ParameterError, ParameterTable};
pub use error::PortError;
pub(crate) use error::refused;
pub use input::{Input, Reading};
pub(crate) use input_place::InputPlace;
pub(crate) use latest::TopicMemory;
pub(crate) use layout::{fits, same_layout};
pub use output::{Loan, Output};
pub(crate) use participant::Participant;
pub(crate) use publication::{OutputPlace, Probe, TopicWriter, Unpublished, checked};
pub(crate) use stream::{Connect, open_queue};
pub use stream::{SliceInput, SliceLoan, SliceOutput};
pub(crate) use tap::side_pin;
pub use tap::{Sample, Tap};
pub(crate) use topic::TopicService;
pub(crate) use trigger::SPIN_NS;
pub use trigger::Trigger;
