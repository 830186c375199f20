//! CAN bus interfaces of the computer.

use motorium_can::OpenError;

/// Returns the error of an interface that cannot be opened, with the next step.
pub(super) fn refused(error: OpenError) -> anyhow::Error {
    anyhow::anyhow!("{error}\n  {}", error.advice())
}
