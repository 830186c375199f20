//! Warnings of the world of a task.

use motorium_robots::ModelWarning;

use crate::out::errln;

/// Prints the warnings about omitted elements of the world's file.
pub(super) fn warn(warnings: &[ModelWarning]) {
    for warning in warnings {
        errln!("warning: world: {warning}");
    }
}
