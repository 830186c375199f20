//! Stages of a homing in mode 6.

use crate::protocols::cia402::codec::HOMING_MODE;
use crate::protocols::homing_fault::HomingFault;

/// Stage of a homing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Stage {
    /// No homing is running.
    #[default]
    None,
    /// This mode is written and read back; then homing starts, or is finished.
    Mode { mode: u8, is_written: bool, asked: u16 },
    /// The drive is being enabled.
    Enabling,
    /// The drive has been searching for its mark for `cycles`; `was_seen` once it has reported the search.
    Running { cycles: u16, was_seen: bool },
    /// The homing is finished.
    Over(Result<(), HomingFault>),
}

impl Stage {
    pub(super) fn mode(mode: u8) -> Self {
        Self::Mode { mode, is_written: false, asked: 0 }
    }

    pub(super) fn begin() -> Self {
        Self::mode(HOMING_MODE)
    }

    pub(super) fn result(self) -> Option<Result<(), HomingFault>> {
        match self {
            Self::Over(result) => Some(result),
            _ => None,
        }
    }
}
