//! Phases of a drive.

/// Phase of one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The settings are being read; this is the number of the next one.
    Checking(u8),
    /// The drive is disabled and its settings are correct.
    Disabled,
    /// The joint moves to the mark that determines its position.
    Homing,
    /// The drive has been ordered to follow commands.
    Enabling,
    /// The drive follows commands.
    Enabled,
    /// The drive disabled itself because of a fault.
    Fault,
}
