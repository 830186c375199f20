//! The share of steps lost by a component, as a pure function of its counters and the time.

/// Interval over which the share is computed, ns.
const SPAN_NS: u64 = 1_000_000_000;
/// Minimum time between two warnings about one component, ns.
const QUIET_NS: u64 = 10_000_000_000;

/// Lost steps of one component: releases or triggering publications that passed while it could not step.
#[derive(Debug, Clone)]
pub(super) struct LostSteps {
    limit: f64,
    since_ns: u64,
    /// Steps and lost steps at that time.
    before: (u64, u64),
    quiet_until_ns: u64,
}

impl LostSteps {
    /// Counts from `now_ns` on, and warns about shares above `limit`.
    pub(super) fn new(limit: f64, now_ns: u64) -> Self {
        Self { limit, since_ns: now_ns, before: (0, 0), quiet_until_ns: 0 }
    }

    /// Starts a new interval, after the component started or the launcher was delayed.
    pub(super) fn count_from(&mut self, now_ns: u64) {
        self.since_ns = now_ns;
    }

    /// Returns the share lost in the finished interval, if it is too large and was not reported recently.
    pub(super) fn check(&mut self, steps: u64, skipped: u64, now_ns: u64) -> Option<f64> {
        if now_ns.saturating_sub(self.since_ns) < SPAN_NS {
            return None;
        }
        let (steps_before, skipped_before) = core::mem::replace(&mut self.before, (steps, skipped));
        self.since_ns = now_ns;
        let LostShare(share) =
            LostShare::new(steps.saturating_sub(steps_before), skipped.saturating_sub(skipped_before));
        if share <= self.limit || now_ns < self.quiet_until_ns {
            return None;
        }
        self.quiet_until_ns = now_ns + QUIET_NS;
        Some(share)
    }
}

/// A share of lost steps, printed in percent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LostShare(pub(super) f64);

impl LostShare {
    /// Creates the share of lost steps among all steps that were due.
    pub(super) fn new(steps: u64, skipped: u64) -> Self {
        Self(skipped as f64 / (steps + skipped).max(1) as f64)
    }
}

impl core::fmt::Display for LostShare {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:.1} %", 100.0 * self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn excessive_loss_is_reported_every_ten_seconds() {
        let mut lost = LostSteps::new(0.05, 0);
        assert_eq!(lost.check(500, 100, S / 2), None, "the second is not over");
        assert_eq!(lost.check(960, 40, S), None, "4 %");
        assert_eq!(lost.check(1_860, 140, 2 * S), Some(0.1));
        assert_eq!(lost.check(2_760, 240, 3 * S), None, "reported a moment ago");
        assert_eq!(lost.check(9_000, 900, 12 * S), Some(660.0 / 6_900.0));
    }

    #[test]
    fn component_without_steps_loses_none() {
        assert_eq!(LostSteps::new(0.05, 0).check(0, 0, S), None);
    }

    #[test]
    fn shares_are_printed_in_percent() {
        assert_eq!(LostShare::new(760, 240).to_string(), "24.0 %");
    }
}
