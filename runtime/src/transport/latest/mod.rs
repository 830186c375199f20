//! The state of a topic: its newest value, used in place by every reader.

pub(crate) mod notify;
pub(crate) mod protocol;
