//! Homing of a CiA 402 drive in mode 6.
//!
//! The homing objects are written while the drive is being checked. While the drive is disabled, service data
//! sent alongside the process data change the mode, and the mode display is read back. Then the state machine
//! is advanced to *operation enabled*, and bit 4 of the controlword starts the homing. The statusword reports
//! the progress.

use super::Cia402;
use super::stage::Stage;
use crate::frame::{DecodeError, Frame};
use crate::protocols::cia402::codec::{
    DISABLE_VOLTAGE, DriveState, HOMING_MODE, HOMING_START, HomingStatus, Object, Service, Value,
};
use crate::protocols::homing_fault::HomingFault;

/// Number of cycles after which an unanswered service is requested again.
const ASK_AGAIN: u16 = 20;
/// Number of cycles from the start to the first relevant statusword; earlier ones may still show the previous
/// homing.
const SETTLES: u16 = 8;

impl Cia402 {
    /// Returns the service required by the current stage.
    fn homing_service(&self) -> Option<Service> {
        match self.homing {
            Stage::Mode { mode, is_written: false, .. } => {
                Some(Service::Write(Object::MODE, Value::byte(mode)))
            }
            Stage::Mode { .. } => Some(Service::Read(Object::MODE_DISPLAY)),
            _ => None,
        }
    }

    /// Returns the controlword of a homing cycle; a service may be sent alongside it.
    pub(super) fn home(&mut self, frames: &mut Vec<Frame>) -> u16 {
        if let Some(service) = self.homing_service()
            && let Stage::Mode { asked, .. } = &mut self.homing
        {
            // two simultaneous requests could be answered in any order
            if *asked == 0 {
                frames.push(self.node.service(&service));
            }
            *asked = (*asked + 1) % ASK_AGAIN;
        }
        match (self.homing, self.state) {
            (Stage::Enabling, DriveState::Enabled) => {
                // a method that uses the current position as the mark finishes immediately
                let is_here = self.homes.is_some_and(|homes| matches!(homes.method, 35 | 37));
                self.homing = Stage::Running { cycles: 0, was_seen: is_here };
                0x0f | HOMING_START
            }
            (Stage::Enabling, state) => state.towards_enabled().unwrap_or(DISABLE_VOLTAGE),
            (Stage::Running { cycles, was_seen }, _) => {
                self.homing = Stage::Running { cycles: cycles.saturating_add(1), was_seen };
                0x0f | HOMING_START
            }
            (Stage::None | Stage::Mode { .. } | Stage::Over(_), _) => DISABLE_VOLTAGE,
        }
    }

    /// Processes the answer to a service.
    pub(super) fn take_homing_service(&mut self, frame: &Frame) {
        let Some(service) = self.homing_service() else { return };
        let value = match self.node.service_result(&service, frame) {
            Ok(value) => value,
            Err(DecodeError::Refused { code }) => {
                self.homing = Stage::Over(Err(HomingFault::Refused(code)));
                return;
            }
            // an answer to an earlier service
            Err(_) => return,
        };
        let Stage::Mode { mode, is_written, asked } = &mut self.homing else { return };
        *asked = 0;
        if !*is_written {
            *is_written = true;
        } else if value.is_some_and(|found| found.number() == u32::from(*mode)) {
            let is_homing = *mode == HOMING_MODE;
            self.homing = if is_homing { Stage::Enabling } else { Stage::Over(Ok(())) };
        }
    }

    /// Processes the statusword of a cycle.
    pub(super) fn take_homing_status(&mut self, statusword: u16) {
        let Stage::Running { cycles, was_seen } = &mut self.homing else { return };
        let status = HomingStatus::from_statusword(statusword);
        *was_seen |= status != HomingStatus::Attained;
        let (cycles, was_seen) = (*cycles, *was_seen);
        if self.state != DriveState::Enabled && cycles > SETTLES {
            self.homing = Stage::Over(Err(HomingFault::LetGo));
            return;
        }
        match status {
            _ if cycles < SETTLES => {}
            HomingStatus::Running => {}
            // left over from the previous homing
            HomingStatus::Attained if !was_seen => {}
            HomingStatus::Attained => self.homing = Stage::mode(self.cyclic() as u8),
            HomingStatus::Failed => self.homing = Stage::Over(Err(HomingFault::Drive)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Table;

    /// Statusword of an enabled drive, and of one that has found its mark.
    const UNDER_WAY: u16 = 0x0237;
    const ATTAINED: u16 = 0x1637;

    fn drive(method: i8) -> Cia402 {
        let text = format!(
            "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"cia402\"\n\
             node = 5\nwatchdog = \"20 ms\"\nincrements = 65536.0\nrated_torque = 5.0\nrated_current = 4.0\ncurrent_limit = 2.0\n\
             ranges = {{ position = 3.0, velocity = 30.0, torque = 2.0 }}\n\
             homing = {{ by = \"drive\", method = {method}, velocity = 0.5, creep_velocity = 0.1, acceleration = 1.0 }}\n"
        );
        let mut drive = Cia402::new(&Table::parse(&text).unwrap().setup(0));
        drive.state = DriveState::Enabled;
        drive
    }

    /// Runs cycles with this statusword.
    fn pass(drive: &mut Cia402, cycles: u16, statusword: u16) {
        for _ in 0..cycles {
            drive.home(&mut Vec::new());
            drive.take_homing_status(statusword);
        }
    }

    #[test]
    fn a_mark_of_an_earlier_homing_does_not_count() {
        let mut drive = drive(17);
        drive.homing = Stage::Enabling;
        pass(&mut drive, 500, ATTAINED);
        assert!(matches!(drive.homing, Stage::Running { .. }), "{:?}", drive.homing);
        pass(&mut drive, 1, UNDER_WAY);
        pass(&mut drive, 1, ATTAINED);
        assert!(matches!(drive.homing, Stage::Mode { mode: 8, .. }), "{:?}", drive.homing);
    }

    #[test]
    fn homing_in_place_may_end_immediately() {
        for method in [35, 37] {
            let mut drive = drive(method);
            drive.homing = Stage::Enabling;
            pass(&mut drive, SETTLES + 2, ATTAINED);
            assert!(matches!(drive.homing, Stage::Mode { mode: 8, .. }), "{:?}", drive.homing);
        }
    }

    #[test]
    fn a_refused_service_ends_homing_with_its_code() {
        let mut drive = drive(17);
        drive.homing = Stage::begin();
        let refused = drive
            .node
            .service_answer(&Service::Write(Object::MODE, Value::byte(HOMING_MODE)), Err(0x0609_0030));
        // an answer about another object is ignored
        let other = drive.node.service_answer(&Service::Read(Object::RATED_TORQUE), Err(0x0602_0000));
        drive.take_homing_service(&other);
        assert_eq!(drive.homing.result(), None);
        drive.take_homing_service(&refused);
        assert_eq!(drive.homing.result(), Some(Err(HomingFault::Refused(0x0609_0030))));
    }
}
