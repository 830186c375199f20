//! The decision on a restart, as a pure function of a component's history.

use crate::plan::{RestartPlan, RestartWhen};

/// Time after its first step within which a failure counts as quick, ns.
const QUICK_NS: u64 = 1_000_000_000;
/// Delay of a restart after the first quick failure, ns; doubled for each further one.
const FIRST_DELAY_NS: u64 = 20_000_000;
/// The longest delay, ns.
const LONGEST_DELAY_NS: u64 = 1_000_000_000;

/// Restarts of one component so far.
#[derive(Debug, Clone, Default)]
pub(super) struct History {
    restarts_ns: Vec<u64>,
    was_restarted: bool,
    /// Consecutive failures, each soon after a restart.
    quick: u32,
}

impl History {
    /// Decides on the restart of a component that ended at `now_ns`, and adds a granted restart to the
    /// history. Returns its delay, ns: zero for the first failure and for a component that stepped for a
    /// second, doubled for each quick failure.
    pub(super) fn grant(
        &mut self,
        policy: &RestartPlan,
        failed: bool,
        stepping_since_ns: Option<u64>,
        now_ns: u64,
    ) -> Option<u64> {
        let wanted = match policy.when {
            RestartWhen::Never => false,
            RestartWhen::Failure => failed,
            RestartWhen::Always => true,
        };
        self.restarts_ns.retain(|restart| now_ns.saturating_sub(*restart) < policy.window_ns);
        if !wanted || self.restarts_ns.len() >= policy.at_most as usize {
            return None;
        }
        self.restarts_ns.push(now_ns);
        let lasted = stepping_since_ns.is_some_and(|since| now_ns.saturating_sub(since) >= QUICK_NS);
        let is_first = !core::mem::replace(&mut self.was_restarted, true);
        self.quick = if lasted || is_first { 0 } else { self.quick.saturating_add(1) };
        Some(match self.quick {
            0 => 0,
            quick => (FIRST_DELAY_NS << (quick - 1).min(10)).min(LONGEST_DELAY_NS),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: RestartPlan =
        RestartPlan { when: RestartWhen::Failure, at_most: 2, window_ns: 1_000, within_ns: 100 };

    #[test]
    fn restarts_are_limited_within_the_window() {
        let mut history = History::default();
        let mut is_granted = |now_ns| history.grant(&POLICY, true, Some(0), now_ns).is_some();
        assert!(is_granted(0));
        assert!(is_granted(10));
        assert!(!is_granted(20));
        assert!(is_granted(1_005));
        assert!(!is_granted(1_006));
    }

    #[test]
    fn only_the_policy_always_restarts_after_an_orderly_end() {
        let mut history = History::default();
        assert_eq!(history.grant(&POLICY, false, Some(0), 0), None);
        let always = RestartPlan { when: RestartWhen::Always, ..POLICY };
        assert!(history.grant(&always, false, Some(0), 0).is_some());
        let never = RestartPlan { when: RestartWhen::Never, ..POLICY };
        assert_eq!(history.grant(&never, true, Some(0), 0), None);
    }

    #[test]
    fn quick_failures_double_the_restart_delay() {
        let policy = RestartPlan { at_most: 100, window_ns: u64::MAX, ..POLICY };
        let mut history = History::default();
        let second = 1_000_000_000;
        let mut delay_ms = |since: Option<u64>, now: u64| {
            history.grant(&policy, true, since, now).map(|delay| delay / 1_000_000)
        };
        assert_eq!(delay_ms(Some(0), 1), Some(0), "the first failure");
        let storm: Vec<Option<u64>> = (0..8).map(|n| delay_ms(None, (6 + n) * second)).collect();
        assert_eq!(storm, [20, 40, 80, 160, 320, 640, 1_000, 1_000].map(Some));
        assert_eq!(delay_ms(Some(20 * second), 21 * second), Some(0), "it has recovered");
    }
}
