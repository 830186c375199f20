//! Manufacturers of servos.

use super::codec::{dynamixel, feetech};
use crate::protocols::dialogue::Layout;

/// Manufacturer of a servo, which determines its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Maker {
    Feetech,
    Dynamixel,
}

/// Setting of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setting {
    Mode,
    Goals,
    Watchdog,
    HomingOffset,
    CurrentLimit,
}

impl Maker {
    /// Returns the registers of the manufacturer's servos.
    pub(crate) fn layout(self) -> &'static Layout {
        match self {
            Self::Feetech => &feetech::LAYOUT,
            Self::Dynamixel => &dynamixel::LAYOUT,
        }
    }

    /// Returns the setting in the block with this index; `None` for the state.
    pub(crate) fn setting(self, block: usize) -> Option<Setting> {
        let settings: &[Setting] = match self {
            Self::Feetech => &[Setting::Mode, Setting::Goals, Setting::HomingOffset, Setting::CurrentLimit],
            Self::Dynamixel => &[
                Setting::Mode,
                Setting::Goals,
                Setting::Watchdog,
                Setting::HomingOffset,
                Setting::CurrentLimit,
            ],
        };
        settings.get(block).copied()
    }

    /// Returns the highest position: the last step of a turn.
    pub(crate) fn highest(self) -> f64 {
        match self {
            Self::Feetech => feetech::position(feetech::TURN as u16 - 1),
            Self::Dynamixel => dynamixel::position(dynamixel::TURN as i32 - 1),
        }
    }
}
