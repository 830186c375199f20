//! Orders to drives.

use crate::mit::Command;

/// Request of the adapter to a drive in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::adapter) enum Order {
    /// Read or write the setting with this number.
    Check(u8),
    /// Disable the drive.
    Disable,
    /// Only answer: the drive reported a fault, which stays latched.
    Rest,
    /// Search for the mark.
    Home,
    /// Start following commands.
    Enable,
    /// Follow a command, in units of the output shaft.
    Follow(Command),
}
