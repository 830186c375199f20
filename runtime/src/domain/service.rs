//! The services of a run: their names, and what can go wrong with one.

use std::path::Path;

use iceoryx2::prelude::ServiceName;

use super::SHARED_MEMORY;
use crate::os::with_shortage;

/// iceoryx2 refused an operation on a service of a run.
#[derive(Debug, thiserror::Error)]
#[error("{owner}: {action} failed: {reason}")]
pub struct ServiceError {
    /// The topic or the component that the service belongs to.
    pub owner: String,
    /// The operation that failed.
    pub action: &'static str,
    /// The error of iceoryx2.
    pub reason: String,
}

/// Makes the error of an operation on a service from its reason; shared memory that is short is named in it.
pub(crate) fn refused(
    owner: String,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> ServiceError {
    move |reason| {
        let reason = with_shortage(reason.to_string(), Path::new(SHARED_MEMORY));
        ServiceError { owner: owner.clone(), action, reason }
    }
}

/// The name of a service: its kind, and the name of the topic or component that it belongs to.
pub(crate) fn service_name(kind: &str, name: &str) -> Result<ServiceName, ServiceError> {
    let refused = refused(format!("{kind} `{name}`"), "naming the service");
    ServiceName::new(&format!("{kind}/{name}")).map_err(|error| refused(&format!("{error:?}")))
}
