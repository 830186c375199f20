//! Hung components and guards, and lost steps.

use std::sync::atomic::Ordering::Relaxed;

use super::lost_steps::LostShare;
use super::supervision::Supervision;
use super::watchdog::{Counters, Overdue};
use super::{Event, Hosting, Launch};
use crate::os::{monotonic_ns, process_state};
use crate::plan::Plan;
use crate::region::{Activity, Hang, Region};

/// Silence after which a launcher or a guard counts as stopped, ns.
pub(super) const SILENCE_NS: u64 = 1_000_000_000;

/// Describes a hang as it is now.
pub(super) fn diagnose(plan: &Plan, region: &Region, index: usize, overdue: Overdue) -> Hang {
    let block = &region.components()[index];
    let (in_step, for_ns) = match overdue {
        Overdue::InStep { for_ns } => (true, for_ns),
        Overdue::BetweenSteps { for_ns } => (false, for_ns),
    };
    let hang_after_ns = plan.components[index].liveness.hang_after_ns;
    let state = process_state(block.pid.load(Relaxed), block.thread.load(Relaxed));
    Hang { in_step, for_ns, hang_after_ns, activity: Activity::from_kernel(state) }
}

impl Launch {
    /// After a long delay of its own, the launcher must not treat components delayed with it as hung.
    pub(super) fn disregard_own_delay(&self, supervision: &mut [Supervision], late: u64, now: u64) {
        for supervision in supervision {
            if late > supervision.watchdog.hang_after_ns() / 2 {
                supervision.watchdog.watch_from(now);
                supervision.lost_steps.count_from(now);
            }
        }
    }

    /// Warns of a component that loses too many steps.
    pub(super) fn count_lost_steps(
        &self,
        index: usize,
        supervision: &mut Supervision,
        now: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let block = &self.region.components()[index];
        let (steps, skipped) = (block.steps.load(Relaxed), block.skipped.load(Relaxed));
        if let Some(share) = supervision.lost_steps.check(steps, skipped, now) {
            observe(Event::LosesSteps { component: &self.plan.components[index].name, share });
        }
    }

    /// Records at the end of a real-time run which components do not meet the graph's requirements.
    pub(super) fn note_unmet(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let supervision = core::mem::take(&mut self.supervision);
        let now = monotonic_ns();
        // Without the requested priorities, punctual steps are not guaranteed.
        let has_priorities = self.options.hosting == Hosting::Processes && self.lost.is_empty();
        for (index, supervision) in supervision.iter().enumerate() {
            let (component, block) = (&self.plan.components[index], &self.region.components()[index]);
            let name = &component.name;
            if let Some(reason) = supervision.lost() {
                self.warnings.push(format!("`{name}` ended before the run: {reason}"));
                continue;
            }
            if supervision.is_down(block.steps.load(Relaxed)) {
                self.warnings.push(format!("`{name}` was restarted and did not step again before the end"));
                continue;
            }
            let lost = LostShare::new(block.steps.load(Relaxed), block.skipped.load(Relaxed));
            if !supervision.is_gone() && lost.0 > component.liveness.lost_steps {
                let warning = format!("`{name}` lost {lost} of its steps");
                if has_priorities {
                    self.warnings.push(warning);
                } else {
                    observe(Event::Warning(&warning));
                }
            }
            // Too short for the watchdog, but long enough to report.
            let counters = Counters::read(&self.plan, &self.region, index);
            let overdue = supervision.watchdog.clone().with_half_the_timeout().check(&counters, now);
            if let Some(overdue) = overdue.filter(|_| !supervision.is_gone()) {
                let hang = diagnose(&self.plan, &self.region, index, overdue);
                self.warnings.push(format!("`{name}` did not step at the end: {hang}"));
            }
        }
        self.warnings.extend(self.guard.missing());
        self.warnings.iter().for_each(|warning| observe(Event::Warning(warning)));
        self.supervision = supervision;
    }
}
