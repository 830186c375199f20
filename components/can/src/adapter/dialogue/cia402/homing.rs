//! The homing of a drive of CiA 402, by its mode 6.
//!
//! Its objects are written while the drive is checked. The mode is changed by service data beside the process data, while the drive
//! is let go, and read back from the object that displays the one in force. Then the state machine is led to enabled, and bit 4 of the
//! controlword starts the homing, whose progress stands in the statusword.

use super::Cia402;
use crate::adapter::HomingFault;
use crate::cia402::{
    DISABLE_VOLTAGE, DriveState, HOMING_MODE, HOMING_START, HomingStatus, Object, Service, Value,
};
use crate::frame::Frame;

/// Cycles after which a service that was not answered is asked for again.
const ASK_AGAIN: u16 = 20;
/// Cycles from the start to the first statusword that counts: it may show the homing before.
const SETTLES: u16 = 8;

/// The stage of a homing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Stage {
    /// None is under way.
    #[default]
    None,
    /// This mode is written and read back; then homing begins, or it is over.
    Mode { mode: u8, is_written: bool, asked: u16 },
    /// The drive is led to enabled.
    Enabling,
    /// It looks for its mark, for so many cycles.
    Running(u16),
    /// It is over.
    Over(Result<(), HomingFault>),
}

impl Stage {
    fn mode(mode: u8) -> Self {
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

impl Cia402 {
    /// The service that the stage asks for.
    fn homing_service(&self) -> Option<Service> {
        match self.homing {
            Stage::Mode { mode, is_written: false, .. } => {
                Some(Service::Write(Object::MODE, Value::byte(mode)))
            }
            Stage::Mode { .. } => Some(Service::Read(Object::MODE_DISPLAY)),
            _ => None,
        }
    }

    /// The controlword of a cycle of homing; a service goes out beside it.
    pub(super) fn home(&mut self, frames: &mut Vec<Frame>) -> u16 {
        if let Some(service) = self.homing_service()
            && let Stage::Mode { asked, .. } = &mut self.homing
        {
            // two at a time would be answered in any order
            if *asked == 0 {
                frames.push(self.node.service(&service));
            }
            *asked = (*asked + 1) % ASK_AGAIN;
        }
        match (self.homing, self.state) {
            (Stage::Enabling, DriveState::Enabled) => {
                self.homing = Stage::Running(0);
                0x0f | HOMING_START
            }
            (Stage::Enabling, state) => state.towards_enabled().unwrap_or(DISABLE_VOLTAGE),
            (Stage::Running(cycles), _) => {
                self.homing = Stage::Running(cycles.saturating_add(1));
                0x0f | HOMING_START
            }
            (Stage::None | Stage::Mode { .. } | Stage::Over(_), _) => DISABLE_VOLTAGE,
        }
    }

    /// Takes the answer to a service.
    pub(super) fn take_homing_service(&mut self, frame: &Frame) {
        let Some(service) = self.homing_service() else { return };
        let Ok(value) = self.node.service_result(&service, frame) else { return };
        let Stage::Mode { mode, is_written, asked } = &mut self.homing else { return };
        *asked = 0;
        if !*is_written {
            *is_written = true;
        } else if value.is_some_and(|found| found.number() == u32::from(*mode)) {
            let is_homing = *mode == HOMING_MODE;
            self.homing = if is_homing { Stage::Enabling } else { Stage::Over(Ok(())) };
        }
    }

    /// Takes the statusword of a cycle.
    pub(super) fn take_homing_status(&mut self, statusword: u16) {
        let Stage::Running(cycles) = self.homing else { return };
        if self.state != DriveState::Enabled && cycles > SETTLES {
            self.homing = Stage::Over(Err(HomingFault::LetGo));
            return;
        }
        match HomingStatus::of(statusword) {
            _ if cycles < SETTLES => {}
            HomingStatus::Running => {}
            HomingStatus::Attained => self.homing = Stage::mode(self.cyclic() as u8),
            HomingStatus::Failed => self.homing = Stage::Over(Err(HomingFault::Drive)),
        }
    }
}
