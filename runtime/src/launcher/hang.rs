//! Hung components and guards.

use std::sync::atomic::Ordering::Relaxed;

use super::watchdog::Overdue;
use crate::os::process_state;
use crate::plan::Plan;
use crate::region::{Activity, Hang, Region};

/// Silence after which a launcher or a guard counts as stopped, ns.
pub(super) const SILENCE_NS: u64 = 1_000_000_000;

/// Describes the current state of a hang.
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
