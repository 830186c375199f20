//! The conditions under which drives are enabled, and their end.

use super::{Adapter, Link, Phase, WrongSetting};

impl Adapter {
    /// The same, with the lowest and highest position of each joint, and the distance beyond them (rad or m)
    /// at which its drive is still enabled. Default: any position.
    #[must_use]
    pub fn with_limits(mut self, limits: &[([f64; 2], f64)]) -> Self {
        self.links.iter_mut().zip(limits).for_each(|(link, limits)| link.limits = *limits);
        self
    }

    /// Lets all drives go, for the rest of the run.
    pub fn release(&mut self) {
        self.links.iter_mut().for_each(|link| (link.is_released, link.is_off) = (true, false));
    }

    /// Returns `true` if each drive has answered that it is off since they were disabled.
    pub fn is_released(&self) -> bool {
        self.links.iter().all(|link| link.is_released && link.is_off)
    }

    /// Refuses to enable drives of which one reads a position outside of its joint's range. Once they have
    /// followed commands the others stay as they are: it trips. True if one does.
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

    /// The drive that was not enabled again, as its joint was outside of its range.
    pub fn out_of_range(&self) -> Option<(usize, WrongSetting)> {
        self.out_of_range
    }
}
