//! Errors of ports and topics.

use crate::domain::{self, ServiceError};

/// A port could not be opened, or a topic could not be created.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The component opened an undeclared port.
    #[error("port `{port}` is not declared; declare it in `Component::declare`")]
    NotDeclared {
        /// The port.
        port: String,
    },
    /// The component opened the port with a type that differs from the declared one.
    #[error("port `{port}` was declared with one type and opened with another:\n{difference}")]
    TypeChanged {
        /// The port.
        port: String,
        /// Both layouts.
        difference: String,
    },
    /// The topic has a different type.
    #[error("topic `{topic}` holds another type than port `{port}` expects:\n{difference}")]
    Layout {
        /// The topic.
        topic: String,
        /// The port.
        port: String,
        /// Both layouts.
        difference: String,
    },
    /// iceoryx2 refused the operation.
    #[error(transparent)]
    Refused(#[from] ServiceError),
}

/// Returns the error of an operation on a topic.
pub(crate) fn refused(
    topic: &str,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> PortError + use<> {
    let refused = domain::refused(format!("topic `{topic}`"), action);
    move |reason| PortError::Refused(refused(reason))
}
