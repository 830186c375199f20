//! Conditions for enabling drives, and the release at the end.

use super::{Adapter, Link, Phase, WrongSetting};

impl Adapter {
    /// Sets the lowest and highest position of each joint, and the distance beyond them (rad or m) at which
    /// its drive is still enabled. Default: any position.
    #[must_use]
    pub fn with_limits(mut self, limits: &[([f64; 2], f64)]) -> Self {
        self.links.iter_mut().zip(limits).for_each(|(link, limits)| link.limits = *limits);
        self
    }

    /// Disables all drives for the rest of the run.
    pub fn release(&mut self) {
        self.links.iter_mut().for_each(|link| (link.is_released, link.is_off) = (true, false));
    }

    /// Returns `true` once each drive has confirmed that it is off after the release.
    pub fn is_released(&self) -> bool {
        self.links.iter().all(|link| link.is_released && link.is_off)
    }

    /// Refuses to enable the drives while a drive reads a position outside of its joint's range, and returns
    /// `true` in that case. If the drives have already followed commands, the adapter trips instead, and the
    /// other drives keep their state.
    pub(super) fn refuse_out_of_range(&mut self) -> bool {
        let disabled = |link: &Link| if link.phase == Phase::Disabled { link.out_of_range() } else { None };
        let found = self.links.iter().enumerate();
        let Some(found) = found.filter_map(|(index, link)| Some((index, disabled(link)?))).next() else {
            return false;
        };
        match self.enabled_in {
            None => self.wrong = self.wrong.or(Some(found)),
            Some(_) => (self.tripped, self.out_of_range) = (true, Some(found)),
        }
        true
    }

    /// Returns the index of the drive that was not enabled again because its joint was out of range, with the
    /// position and the range of the joint.
    pub fn out_of_range(&self) -> Option<(usize, WrongSetting)> {
        self.out_of_range
    }
}
