//! Interfaces of buses.

use motorium_can::OpenError;

/// An interface that cannot be opened, with the next step.
pub(super) fn refused(error: OpenError) -> anyhow::Error {
    anyhow::anyhow!("{error}\n  {}", error.advice())
}
