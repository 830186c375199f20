//! Homing of all joints, in ascending `order` of the drive table.

use super::{Adapter, HomingState, Link, Phase};
use crate::protocols::dialogue::Dialogue as _;

impl Adapter {
    /// Allows homing to continue (the default), or stops it. Stopping immediately disables the joints in
    /// progress; their homing restarts when it is allowed again. While homing is stopped, joints that are
    /// held follow the setpoints of [`set`](Self::set).
    pub fn allow_homing(&mut self, is_allowed: bool) {
        let was_allowed = core::mem::replace(&mut self.is_homing_allowed, is_allowed);
        if !is_allowed {
            self.links.iter_mut().for_each(Link::interrupt_homing);
        } else if !was_allowed && self.awaits_homing() {
            self.links.iter_mut().filter(|link| link.phase == Phase::Enabled).for_each(Link::hold);
        }
    }

    /// Returns `true` while homing is allowed.
    pub fn allows_homing(&self) -> bool {
        self.is_homing_allowed
    }

    /// Returns `true` if some joint still has to be homed.
    pub fn awaits_homing(&self) -> bool {
        !self.links.iter().all(Link::is_homed)
    }

    /// Advances the homing of the joints by a cycle, lowest order first.
    pub(super) fn advance_homing(&mut self) {
        if self.tripped || self.is_observer || !self.is_homing_allowed {
            self.links.iter_mut().for_each(Link::interrupt_homing);
            return;
        }
        for link in &mut self.links {
            if let Some(Err(fault)) = link.advance_homing(self.cycle_ns) {
                link.end_homing(HomingState::Failed(fault));
                self.tripped = true;
            }
        }
        if self.tripped {
            // these joints are disabled because of another joint
            self.links.iter_mut().for_each(Link::interrupt_homing);
            return;
        }
        let is_ready = |link: &Link| match link.phase {
            Phase::Disabled => link.fresh && link.answers.is_present(),
            Phase::Enabled => true,
            Phase::Checking(_) | Phase::Homing | Phase::Enabling | Phase::Fault => false,
        };
        if !self.links.iter().all(is_ready) {
            return;
        }
        let homings = self.links.iter().filter_map(|link| link.homing.as_ref());
        let waiting = homings.filter(|homing| homing.state == HomingState::Waiting);
        let first = waiting.map(|homing| homing.order).min();
        for link in &mut self.links {
            if let Some(homing) = &mut link.homing
                && homing.state == HomingState::Waiting
                && Some(homing.order) == first
            {
                homing.begin();
                link.dialogue.begin_homing();
                link.phase = Phase::Homing;
            }
        }
    }
}
