//! Errors of ports and topics.

use crate::domain::{self, ServiceError};

/// Error of creating a topic or opening a port.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The component opened a port that it did not declare.
    #[error("port `{port}` is not declared; declare it in `Component::declare`")]
    NotDeclared {
        /// Name of the port.
        port: String,
    },
    /// The component opened a port with a type other than the declared type.
    #[error("port `{port}` is opened with a type that differs from its declared type:\n{difference}")]
    TypeChanged {
        /// Name of the port.
        port: String,
        /// Both layouts side by side, for the message.
        difference: String,
    },
    /// The topic and the port have different types.
    #[error("the type of topic `{topic}` differs from the type of port `{port}`:\n{difference}")]
    Layout {
        /// Name of the topic.
        topic: String,
        /// Name of the port.
        port: String,
        /// Both layouts side by side, for the message.
        difference: String,
    },
    /// An iceoryx2 operation failed.
    #[error(transparent)]
    Refused(#[from] ServiceError),
}

/// Returns a function that converts the reason of a failed `action` on a topic to an error.
pub(crate) fn refused(
    topic: &str,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> PortError + use<> {
    let refused = domain::refused(format!("topic `{topic}`"), action);
    move |reason| PortError::Refused(refused(reason))
}
