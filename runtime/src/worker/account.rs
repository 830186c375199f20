//! Statistics of one component: cost of its steps, late steps and their causes.

use std::sync::atomic::Ordering::Relaxed;

use super::timing::Timing;
use super::verdict::{Evidence, LeakyCounter};
use crate::os::{WaitedForCore, thread_cpu_ns, times_asleep};
use crate::plan::{ComponentPlan, OnOverrun};
use crate::region::{ComponentBlock, MissCause, add};

/// Number of steps between two readings of the kernel's waiting and sleeping times, which keeps old waiting
/// from being attributed to a miss. A reading costs about as much as a short step.
const REFRESH: u32 = 64;

/// Statistics from step to step. All of this runs after a step has published, outside the hot path.
#[derive(Debug)]
pub(super) struct Accounts {
    /// CPU time that a step may take, ns.
    budget_ns: Option<u64>,
    /// Additional time for which it may wait for an answer, ns.
    waits_ns: u64,
    tolerated: Option<u32>,
    cpu_ns: u64,
    spun_ns: u64,
    waited: WaitedForCore,
    waited_ns: Option<u64>,
    handed_over_ns: u64,
    asleep: u64,
    waits: u64,
    since_refresh: u32,
    overruns: LeakyCounter,
    last_cause: Option<MissCause>,
}

/// The consequence of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Consequence {
    GoOn,
    /// The graph stops safely, because there were more overruns than it tolerates.
    SafeStop,
}

impl Accounts {
    pub(super) fn new(plan: &ComponentPlan) -> Self {
        let strict = plan.on_overrun == OnOverrun::SafeStop;
        Self {
            budget_ns: plan.budget_ns,
            waits_ns: plan.waits_ns,
            tolerated: plan.overruns_tolerated.or(strict.then_some(0)),
            cpu_ns: 0,
            spun_ns: 0,
            waited: WaitedForCore::of_this_thread(),
            waited_ns: None,
            handed_over_ns: 0,
            asleep: 0,
            waits: 0,
            since_refresh: 0,
            overruns: LeakyCounter::default(),
            last_cause: None,
        }
    }

    /// Starts counting; earlier time belongs to the set-up.
    pub(super) fn open(&mut self) {
        self.cpu_ns = thread_cpu_ns();
        self.refresh();
    }

    /// Records that the worker slept before the next step; any other sleep is attributed to the component.
    pub(super) fn slept(&mut self) {
        self.waits += 1;
    }

    /// Adds time for which components triggered by this step had the core, ns; it does not count as waiting.
    pub(super) fn handed_over(&mut self, ns: u64) {
        self.handed_over_ns += ns;
    }

    /// Adds time spent spinning before the next release, ns; it is not part of the step.
    pub(super) fn spun(&mut self, ns: u64) {
        self.spun_ns += ns;
    }

    /// Records the CPU time of the step that just ended, and returns it in ns.
    pub(super) fn charge(&mut self, block: &ComponentBlock) -> u64 {
        let now = thread_cpu_ns();
        let cpu = now.saturating_sub(self.cpu_ns).saturating_sub(self.spun_ns);
        (self.cpu_ns, self.spun_ns) = (now, 0);
        block.cpu.record(cpu);
        cpu
    }

    /// Records a finished step in real time.
    pub(super) fn enter(&mut self, block: &ComponentBlock, timing: Timing, end_ns: u64) -> Consequence {
        let cpu_ns = self.charge(block);
        block.lateness.record(timing.wake_ns.saturating_sub(timing.release_ns));
        let late = end_ns > timing.deadline_ns;
        let evidence = Evidence {
            release_ns: timing.release_ns,
            wake_ns: timing.wake_ns,
            end_ns,
            deadline_ns: timing.deadline_ns,
            cpu_ns,
            waited_ns: if late { self.waited_since() } else { None },
            blocked: late && times_asleep() - self.asleep > self.waits,
            waits_ns: self.waits_ns,
            behind: timing.behind.then(|| self.last_cause.unwrap_or(MissCause::LongStep)),
        };
        block.execution.record(evidence.execution_ns());
        let waited_ns = if evidence.blocked { self.waits_ns } else { 0 };
        if self.budget_ns.is_some_and(|budget| evidence.own_ns() > budget.saturating_add(waited_ns)) {
            add(&block.over_budget, 1);
        }
        self.last_cause = evidence.cause();
        if let Some(cause) = self.last_cause {
            block.miss(cause);
        }
        self.since_refresh += 1;
        if late || self.since_refresh >= REFRESH {
            self.refresh();
        }
        if self.overruns.count(late, self.tolerated) { Consequence::SafeStop } else { Consequence::GoOn }
    }

    fn refresh(&mut self) {
        (self.since_refresh, self.waits, self.handed_over_ns) = (0, 0, 0);
        self.waited_ns = self.waited.total_ns();
        self.asleep = times_asleep();
    }

    fn waited_since(&self) -> Option<u64> {
        let waited = self.waited.total_ns()?.saturating_sub(self.waited_ns?);
        Some(waited.saturating_sub(self.handed_over_ns))
    }
}

/// Publishes the spin time in the control block.
pub(super) fn show_spin(block: &ComponentBlock, margin_ns: u64, spun_ns: u64) {
    block.spin_ns.store(margin_ns, Relaxed);
    block.watched(spun_ns);
}
