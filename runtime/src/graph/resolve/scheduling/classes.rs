//! Scheduling classes and priorities.

use super::super::activate;
use super::super::draft::Draft;
use super::super::timing::Timing;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::read::good;
use crate::graph::values::{Choice as _, Schedule};
use crate::plan::SchedulingClass;
use crate::schedule::{Overheads, assign};
use crate::units::TimeSpan;

/// Highest priority of a component; 99 is reserved for the kernel's threads.
pub(super) const HIGHEST_PRIORITY: u8 = 98;
/// Periods that Linux allows for `SCHED_DEADLINE` by default, ns.
const DEADLINE_PERIODS_NS: std::ops::RangeInclusive<u64> = 100_000..=4_194_304_000;
/// Time for the worker in each period in addition to the budget, with margin, ns. Without it, a step that
/// uses up its budget would be throttled before its accounting.
const DEADLINE_ROOM_NS: u64 = 120_000;
const _: () = assert!(DEADLINE_ROOM_NS >= Overheads::CAUTIOUS.worker_ns + Overheads::CAUTIOUS.timer_ns);

/// Returns the leader of a component: the component whose core and priority it inherits. This is the
/// real-time head of its trigger chain, or else the component itself.
pub(super) fn leader(component: usize, schedules: &[Schedule], timing: &Timing) -> usize {
    timing.head[component].filter(|head| schedules[*head] == Schedule::Fifo).unwrap_or(component)
}

/// Returns the class and priority of each component: from the file, or else by its rate.
pub(super) fn classes(
    drafts: &[Draft<'_, '_>],
    schedules: &[Schedule],
    timing: &Timing,
    report: &mut Report,
) -> Vec<SchedulingClass> {
    let given: Vec<Option<u8>> =
        drafts.iter().zip(schedules).map(|(draft, schedule)| priority(draft, *schedule, report)).collect();
    for (component, draft) in drafts.iter().enumerate() {
        let Some(head) = timing.head[component] else { continue };
        if schedules[component] == Schedule::Fifo && schedules[head] == Schedule::Normal {
            report
                .warning(format!(
                    "component `{}` is real-time, but waits for `{}`, which is not real-time",
                    draft.name, drafts[head].name
                ))
                .label(&draft.place, "any other program can delay its trigger chain")
                .and(&drafts[head].place, "scheduled as `normal`")
                .advise("schedule both in the same way");
        }
    }
    // rate-monotonic among components without an explicit priority
    let open: Vec<usize> = (0..drafts.len())
        .filter(|component| schedules[*component] == Schedule::Fifo)
        .filter(|component| {
            leader(*component, schedules, timing) == *component && given[*component].is_none()
        })
        .collect();
    let periods: Vec<u64> =
        open.iter().map(|component| timing.period_ns(*component).unwrap_or(u64::MAX)).collect();
    let by_rate = assign::rate_monotonic(&periods, defaults::FASTEST_PRIORITY, defaults::PRIORITY_STEP);
    let rated = |leader: usize| open.iter().position(|other| *other == leader).map_or(1, |at| by_rate[at]);
    (0..drafts.len())
        .map(|component| match schedules[component] {
            Schedule::Normal => SchedulingClass::Normal,
            Schedule::Fifo => {
                let leader = leader(component, schedules, timing);
                SchedulingClass::Fifo(given[component].or(given[leader]).unwrap_or_else(|| rated(leader)))
            }
            Schedule::Deadline => deadline(&drafts[component], timing.period_ns(component), report),
        })
        .collect()
}

/// Returns the class of a component scheduled by deadline. The kernel guarantees the budget in every period,
/// so both must be known.
fn deadline(draft: &Draft<'_, '_>, period_ns: Option<u64>, report: &mut Report) -> SchedulingClass {
    let table = draft.table;
    let name = draft.name;
    let budget_ns = good(&table.budget).map(|budget| budget.ns);
    let place = table.schedule.as_ref().map_or(&draft.place, |at| &at.span);
    if table.budget.is_none() {
        report
            .error(format!("component `{name}` is scheduled by its deadline but has no budget"))
            .label(place, "the kernel must know the CPU time per period")
            .advise("add a budget such as `budget = \"200 us\"`; `motorium calibrate` proposes a value");
    }
    if let Some((trigger, _, label)) = activate::not_by_the_clock(draft) {
        report
            .error(format!("component `{name}` is scheduled by its deadline but has no rate"))
            .label(place, "the kernel grants CPU time in fixed periods")
            .and(trigger, label)
            .advise("give it a `rate`, or schedule it as `fifo`");
    }
    let period_ns = period_ns.unwrap_or(*DEADLINE_PERIODS_NS.start());
    if let Some(rate) = table.rate.as_ref().filter(|_| !DEADLINE_PERIODS_NS.contains(&period_ns)) {
        report
            .error(format!("the kernel does not schedule component `{name}` by its deadline"))
            .label(&rate.span, format!("a period of {}", TimeSpan { ns: period_ns }))
            .and(place, "`SCHED_DEADLINE` accepts periods from 100 us to 4.19 s")
            .advise("schedule it as `fifo`");
    }
    let runtime_ns = (budget_ns.unwrap_or(0) + DEADLINE_ROOM_NS).min(period_ns);
    SchedulingClass::Deadline { runtime_ns, period_ns }
}

/// Returns the priority in the file.
fn priority(draft: &Draft<'_, '_>, schedule: Schedule, report: &mut Report) -> Option<u8> {
    let at = draft.table.priority.as_ref()?;
    let number = *at.get()?;
    let priority = u8::try_from(number).ok().filter(|priority| (1..=HIGHEST_PRIORITY).contains(priority));
    if priority.is_none() {
        report
            .error(format!("the priority of component `{}` is {number}", draft.name))
            .label(&at.span, format!("expected 1 to {HIGHEST_PRIORITY}"))
            .advise(
                "a higher number is more urgent; without `priority`, faster components get higher priorities",
            );
    }
    let (why, label) = match schedule {
        Schedule::Fifo => return priority,
        Schedule::Normal => ("is not real-time", "not real-time"),
        Schedule::Deadline => ("is scheduled by its deadline", "before all priorities"),
    };
    let diagnostic = report
        .error(format!("component `{}` has a priority but {why}", draft.name))
        .label(&at.key, format!("does not apply to `schedule = \"{}\"`", schedule.word()))
        .advise("leave `priority` out, or schedule the component as `fifo`");
    if let Some(schedule) = &draft.table.schedule {
        diagnostic.and(&schedule.span, label);
    }
    None
}
