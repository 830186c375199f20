//! States and faults reported by drives, and their codes.

use crate::frame::DecodeError;

/// State reported by a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Not reported.
    Unknown,
    /// The drive is disabled.
    Disabled,
    /// The drive follows commands.
    Enabled,
    /// The drive disabled itself because of a fault.
    Fault(Fault),
}

/// Fault of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The supply voltage is too high.
    OverVoltage,
    /// The supply voltage is too low.
    UnderVoltage,
    /// The current is too high.
    OverCurrent,
    /// The transistors are too hot.
    HotTransistors,
    /// The motor is too hot.
    HotMotor,
    /// No command arrived within the watchdog time.
    CommunicationLost,
    /// The motor could not deliver the torque for too long.
    Overload,
    /// The encoder failed.
    Encoder,
    /// Any other fault, with the drive's code.
    Other(u32),
}

impl Fault {
    /// Short description of the fault.
    pub fn description(self) -> &'static str {
        match self {
            Self::OverVoltage => "supply voltage too high",
            Self::UnderVoltage => "supply voltage too low",
            Self::OverCurrent => "current too high",
            Self::HotTransistors => "transistors too hot",
            Self::HotMotor => "motor too hot",
            Self::CommunicationLost => "no command for the time of its watchdog",
            Self::Overload => "overload",
            Self::Encoder => "encoder failed",
            Self::Other(_) => "a fault that the drive has a code for",
        }
    }

    /// Drive-specific code of a fault that has no name here.
    pub fn code(self) -> Option<u32> {
        match self {
            Self::Other(code) => Some(code),
            _ => None,
        }
    }
}

pub(super) fn cubemars_state(code: u8) -> Result<State, DecodeError> {
    Ok(match code {
        0 => State::Unknown,
        1 => State::Fault(Fault::HotMotor),
        2 => State::Fault(Fault::OverCurrent),
        3 => State::Fault(Fault::OverVoltage),
        4 => State::Fault(Fault::UnderVoltage),
        5 => State::Fault(Fault::Encoder),
        6 => State::Fault(Fault::HotTransistors),
        7 => State::Fault(Fault::Overload),
        code => return Err(DecodeError::Field { field: "the error", found: code.into() }),
    })
}

pub(super) fn cubemars_code(state: State) -> u8 {
    match state {
        State::Fault(Fault::HotMotor) => 1,
        State::Fault(Fault::OverCurrent) => 2,
        State::Fault(Fault::OverVoltage) => 3,
        State::Fault(Fault::UnderVoltage) => 4,
        State::Fault(Fault::Encoder) => 5,
        State::Fault(Fault::HotTransistors) => 6,
        State::Fault(Fault::Overload) => 7,
        // it has no code for other faults
        _ => 0,
    }
}

pub(super) fn damiao_state(code: u8) -> Result<State, DecodeError> {
    Ok(match code {
        0x0 => State::Disabled,
        0x1 => State::Enabled,
        0x8 => State::Fault(Fault::OverVoltage),
        0x9 => State::Fault(Fault::UnderVoltage),
        0xa => State::Fault(Fault::OverCurrent),
        0xb => State::Fault(Fault::HotTransistors),
        0xc => State::Fault(Fault::HotMotor),
        0xd => State::Fault(Fault::CommunicationLost),
        0xe => State::Fault(Fault::Overload),
        code => return Err(DecodeError::Field { field: "the state", found: code.into() }),
    })
}

pub(super) fn damiao_code(state: State) -> u8 {
    match state {
        State::Unknown | State::Disabled => 0x0,
        State::Enabled => 0x1,
        State::Fault(Fault::OverVoltage) => 0x8,
        State::Fault(Fault::UnderVoltage) => 0x9,
        State::Fault(Fault::OverCurrent) => 0xa,
        State::Fault(Fault::HotTransistors) => 0xb,
        State::Fault(Fault::HotMotor) => 0xc,
        State::Fault(Fault::CommunicationLost) => 0xd,
        State::Fault(Fault::Overload | Fault::Encoder | Fault::Other(_)) => 0xe,
    }
}
