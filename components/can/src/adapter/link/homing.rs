//! Homing of the joint of a drive.

use super::{Link, Reading};
use crate::adapter::homing::Outcome;
use crate::adapter::{HomingFault, HomingState, OnTrip, Phase};
use crate::protocols::dialogue::{Dialogue as _, Order};
use motorium_drive::JointSetpoint;

impl Link {
    /// Returns `true` if the joint is homed or needs no homing, so that the drive's reading is the joint's
    /// position.
    pub fn is_homed(&self) -> bool {
        self.homing.as_ref().is_none_or(|homing| homing.state == HomingState::Homed)
    }

    /// Returns the progress of the homing; `None` for a joint without homing.
    pub fn homing(&self) -> Option<HomingState> {
        self.homing.as_ref().map(|homing| homing.state)
    }

    /// Discards the homing: the drive's reading is no longer the joint's position.
    pub(in crate::adapter) fn forget_homing(&mut self) {
        if let Some(homing) = &mut self.homing
            && !matches!(homing.state, HomingState::Failed(_))
        {
            homing.forget();
        }
    }

    /// Disables the drive in the middle of its homing, which restarts later.
    pub(in crate::adapter) fn interrupt_homing(&mut self) {
        if self.phase == Phase::Homing {
            self.end_homing(HomingState::Waiting);
        }
    }

    /// Disables the drive after a trip if it is homing or being enabled, or if `on_trip` requires it. The
    /// drive has not disabled itself, so a completed homing remains valid.
    pub(in crate::adapter) fn let_go(&mut self, on_trip: OnTrip) {
        self.interrupt_homing();
        let lets_go = self.phase == Phase::Enabled && on_trip == OnTrip::Disable;
        if lets_go || self.phase == Phase::Enabling {
            (self.phase, self.fresh) = (Phase::Disabled, false);
        }
    }

    /// Ends the homing and disables the drive.
    pub(in crate::adapter) fn end_homing(&mut self, state: HomingState) {
        if self.phase == Phase::Homing {
            (self.phase, self.fresh) = (Phase::Disabled, false);
        }
        if let Some(homing) = &mut self.homing {
            homing.state = state;
        }
    }

    /// Returns the order of a homing cycle.
    pub(in crate::adapter) fn homing_order(&self) -> Order {
        match self.homing.as_ref().map(|homing| &homing.stop) {
            Some(Some(stop)) if stop.is_enabled => {
                let (velocity, kd) = stop.command(self.reading.velocity);
                self.command(JointSetpoint { velocity, kd, ..JointSetpoint::default() })
            }
            Some(Some(_)) => Order::Enable,
            _ => Order::Home,
        }
    }

    /// Advances the homing by a cycle. Returns the result once it has finished.
    pub(in crate::adapter) fn advance_homing(&mut self, cycle_ns: u64) -> Option<Result<(), HomingFault>> {
        let Self { homing: Some(homing), phase: Phase::Homing, dialogue, gear, .. } = self else {
            return None;
        };
        let Some(stop) = &mut homing.stop else {
            match dialogue.homing_result() {
                Some(Ok(())) => self.end_homing(HomingState::Homed),
                Some(Err(fault)) => return Some(Err(fault)),
                None if homing.pass(cycle_ns) => return Some(Err(HomingFault::TimedOut)),
                None => {}
            }
            return None;
        };
        if stop.is_enabled && self.answers.is_present() {
            // the offset cancels out, so any constant works
            match stop.step(self.reading.position - gear.offset, cycle_ns) {
                Outcome::Moving => {}
                Outcome::Failed(fault) => return Some(Err(fault)),
                Outcome::Found(at) => {
                    let moved = stop.position - at - gear.offset;
                    gear.offset += moved;
                    self.reading.position += moved;
                    homing.state = HomingState::Homed;
                    self.phase = Phase::Enabled;
                    self.hold();
                    return Some(Ok(()));
                }
            }
        }
        homing.pass(cycle_ns).then_some(Err(HomingFault::TimedOut))
    }

    /// Holds the joint at its position with the safe-state gains until it is commanded.
    pub(in crate::adapter) fn hold(&mut self) {
        let Self { reading: Reading { position, .. }, stiffness: kp, damping: kd, .. } = *self;
        self.setpoint = JointSetpoint { position, kp, kd, ..JointSetpoint::default() };
    }
}
