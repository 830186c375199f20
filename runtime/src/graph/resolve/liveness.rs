//! Liveness limits: time without a step, computing time without waiting, and lost steps.

use super::draft::Draft;
use super::timing::Timing;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::{At, good, good_or};
use crate::graph::values::{Choice as _, Schedule};
use crate::plan::LivenessPlan;
use crate::units::TimeSpan;

/// Determines the limits of every component: its own, or else the graph's, or else the defaults.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    timing: &Timing,
    report: &mut Report,
) -> Vec<LivenessPlan> {
    let table = good(&graph.realtime);
    let whole = table.and_then(|table| table.hang_after.as_ref());
    let lost_steps =
        table.map_or(defaults::LOST_STEPS, |table| good_or(&table.lost_steps, defaults::LOST_STEPS));
    let of = |component: usize, report: &mut Report| {
        let draft = &drafts[component];
        let schedule = draft.schedule();
        let period_ns = timing.period_ns(component).unwrap_or(0);
        let at = draft.table.hang_after.as_ref().or(whole);
        if let Some(at) = at {
            long_enough(draft, at, period_ns, report);
        }
        let shortest =
            if schedule == Schedule::Normal { defaults::HANG_NORMAL } else { defaults::HANG_REALTIME };
        let hang_after_ns = at.and_then(At::get).map(|time| time.ns);
        LivenessPlan {
            hang_after_ns: hang_after_ns
                .unwrap_or_else(|| period_ns.saturating_mul(defaults::HANG_PERIODS).max(shortest.ns)),
            cpu_limit_ns: cpu_limit(draft, schedule, period_ns, report),
            lost_steps: good_or(&draft.table.lost_steps, lost_steps).0,
        }
    };
    (0..drafts.len()).map(|component| of(component, report)).collect()
}

/// Checks that a component that waits for its next release does not count as hung.
fn long_enough(draft: &Draft<'_, '_>, at: &At<TimeSpan>, period_ns: u64, report: &mut Report) {
    let Some(time) = at.get().filter(|time| time.ns < 2 * period_ns || time.ns == 0) else { return };
    let period = TimeSpan { ns: period_ns };
    report
        .error(format!(
            "`hang_after` is {time}, expected at least two periods of component `{}` ({period} each)",
            draft.name
        ))
        .label(&at.span, "shorter than two periods")
        .and(&draft.place, "would count as hung while it waits for its next release")
        .advise(format!("write `{}` or more", TimeSpan { ns: (2 * period_ns).max(1_000_000) }));
}

/// Returns the limit on computing without waiting, which only `SCHED_FIFO` has.
fn cpu_limit(draft: &Draft<'_, '_>, schedule: Schedule, period_ns: u64, report: &mut Report) -> Option<u64> {
    let given = draft.table.cpu_limit.as_ref();
    let budget_ns = good(&draft.table.budget).map(|budget| budget.ns);
    if schedule != Schedule::Fifo {
        if let Some(at) = given {
            let advice = match schedule {
                Schedule::Deadline => {
                    "the kernel suspends the component when its budget is used up; leave `cpu_limit` out"
                }
                _ => {
                    "the component does not block its core, because it is not real-time; leave `cpu_limit` out"
                }
            };
            report
                .error(format!("component `{}` has a `cpu_limit` but is not scheduled as `fifo`", draft.name))
                .label(&at.key, format!("does not apply to `schedule = \"{}\"`", schedule.word()))
                .advise(advice);
        }
        return None;
    }
    let Some(at) = given else {
        let step_ns = budget_ns.unwrap_or(period_ns);
        return Some(step_ns.saturating_mul(defaults::CPU_LIMIT_STEPS).max(defaults::CPU_LIMIT.ns));
    };
    let limit = at.get()?;
    let shortest = TimeSpan { ns: budget_ns.unwrap_or(0).max(1_000_000) };
    if limit.ns < shortest.ns {
        report
            .error(format!("the `cpu_limit` of component `{}` is {limit}", draft.name))
            .label(&at.span, "shorter than the budget, or too short for the kernel to measure")
            .advise(format!("write `{shortest}` or more, or leave `cpu_limit` out"));
    }
    Some(limit.ns)
}
