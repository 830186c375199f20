//! The decision on a restart, as a pure function of a component's history.

use crate::plan::{RestartPlan, RestartWhen};

/// The restarts of one component so far.
#[derive(Debug, Clone, Default)]
pub(super) struct History {
    restarts_ns: Vec<u64>,
}

impl History {
    /// Decides on a component that ended at `now_ns`; a granted restart is added to the history.
    pub(super) fn grant(&mut self, policy: &RestartPlan, failed: bool, now_ns: u64) -> bool {
        let wanted = match policy.when {
            RestartWhen::Never => false,
            RestartWhen::Failure => failed,
            RestartWhen::Always => true,
        };
        self.restarts_ns.retain(|restart| now_ns.saturating_sub(*restart) < policy.window_ns);
        if wanted && self.restarts_ns.len() < policy.at_most as usize {
            self.restarts_ns.push(now_ns);
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: RestartPlan =
        RestartPlan { when: RestartWhen::Failure, at_most: 2, window_ns: 1_000, within_ns: 100 };

    #[test]
    fn restarts_are_limited_within_the_window_and_granted_again_after_it() {
        let mut history = History::default();
        assert!(history.grant(&POLICY, true, 0));
        assert!(history.grant(&POLICY, true, 10));
        assert!(!history.grant(&POLICY, true, 20));
        assert!(history.grant(&POLICY, true, 1_005));
        assert!(!history.grant(&POLICY, true, 1_006));
    }

    #[test]
    fn an_orderly_end_is_restarted_only_by_the_policy_always() {
        let mut history = History::default();
        assert!(!history.grant(&POLICY, false, 0));
        assert!(history.grant(&RestartPlan { when: RestartWhen::Always, ..POLICY }, false, 0));
        assert!(!history.grant(&RestartPlan { when: RestartWhen::Never, ..POLICY }, true, 0));
    }
}
