//! A pause of a worker that otherwise never sleeps.
//!
//! The kernel kills a real-time process that computes for longer than its `cpu_limit` without waiting. The
//! limit is meant for a step that does not end. A worker that is behind schedule begins one step after
//! another and would be killed for their total time. It therefore sleeps for a moment, which also lets
//! threads of lower priority run on its core.

use crate::os::{monotonic_ns, sleep_until, times_asleep};
use crate::plan::ComponentPlan;

/// Length of a rest, ns.
const REST_NS: u64 = 50_000;
/// Longest time without sleep, ns.
const LONGEST_NS: u64 = 5_000_000;
/// Attempts to fall asleep.
const ATTEMPTS: usize = 10;

/// Tracks the time since a worker slept.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest {
    /// Time without sleep after which it pauses, ns: at most half the limit, which leaves the other half for
    /// a step.
    after_ns: u64,
    slept_ns: u64,
}

impl Rest {
    pub(super) fn new(component: &ComponentPlan) -> Self {
        let after_ns = component.liveness.cpu_limit_ns.map_or(u64::MAX, |limit| (limit / 2).min(LONGEST_NS));
        Self { after_ns, slept_ns: monotonic_ns() }
    }

    /// Records that the worker slept until `now_ns`.
    #[inline]
    pub(super) fn slept(&mut self, now_ns: u64) {
        self.slept_ns = now_ns;
    }

    /// Returns `true` if a rest is due at `now_ns`.
    #[inline]
    pub(super) fn is_due(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.slept_ns) > self.after_ns
    }

    /// Sleeps for one rest.
    #[cold]
    pub(super) fn take(&mut self) {
        let before = times_asleep();
        // A worker that is preempted before its sleep finds the time already past and does not sleep.
        for _ in 0..ATTEMPTS {
            sleep_until(monotonic_ns() + REST_NS);
            if times_asleep() > before {
                break;
            }
        }
        self.slept_ns = monotonic_ns();
    }
}
