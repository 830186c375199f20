//! Services of a run: names and errors.

use std::path::Path;

use iceoryx2::prelude::ServiceName;

use super::SHARED_MEMORY;
use crate::os::with_shortage;

/// Error of an iceoryx2 operation on a service of a run.
#[derive(Debug, thiserror::Error)]
#[error("{owner}: {action} failed: {reason}")]
pub struct ServiceError {
    /// Topic or component that the service belongs to.
    pub owner: String,
    /// The operation that failed.
    pub action: &'static str,
    /// Reason for the failure, as reported by iceoryx2.
    pub reason: String,
}

/// Converts the error of a service operation. Exhausted shared memory is named explicitly.
pub(crate) fn refused(
    owner: String,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> ServiceError {
    move |reason| {
        let reason = with_shortage(reason.to_string(), Path::new(SHARED_MEMORY));
        ServiceError { owner: owner.clone(), action, reason }
    }
}

/// Returns the name of a service: its kind, and the name of the topic or component that it belongs to.
pub(crate) fn service_name(kind: &str, name: &str) -> Result<ServiceName, ServiceError> {
    let refused = refused(format!("{kind} `{name}`"), "naming the service");
    ServiceName::new(&format!("{kind}/{name}")).map_err(|error| refused(&format!("{error:?}")))
}
