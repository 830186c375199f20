//! The load of real-time components on a core, compared with the kernel's limit.

use super::words;
use crate::plan::Plan;
use crate::schedule::admission::{Activity, CoreLoad, DeadlineLoad, LoadTerm, Verdict};
use crate::schedule::analysis::overheads::RtLimit;
use crate::schedule::analysis::tasks::{Reservation, StaticPlan};

/// Returns the load of one core.
pub(in crate::schedule) fn load(plan: &Plan, tasks: &StaticPlan, core: usize, limit: &RtLimit) -> CoreLoad {
    let mut terms = Vec::new();
    let mut known = true;
    for task in tasks.on_core(core).into_iter().map(|index| &tasks.tasks[index]) {
        let mut add = |component: usize, activity, cost_ns: u64| {
            terms.push(LoadTerm {
                component: plan.components[component].name.clone(),
                activity,
                cost_ns,
                period_ns: task.period_ns,
                share: cost_ns as f64 / task.period_ns as f64,
            });
        };
        if task.spin_ns() > 0 {
            add(task.head(), Activity::Spin, task.spin_ns());
        }
        for step in task.steps() {
            known &= step.budget_ns.is_some();
            add(step.component, Activity::Step, step.cost_ns());
        }
    }
    // every SCHED_DEADLINE component may run here
    terms.extend(tasks.reservations.iter().map(|reservation| term(plan, reservation)));
    let share: f64 = terms.iter().map(|term| term.share).sum();
    let limit = limit.share();
    // sums of shares that are not binary fractions may miss the limit by a rounding error
    let holds = share <= limit + 1e-9;
    let digits = words::shares(share, limit);
    let parts: Vec<String> = terms
        .iter()
        .enumerate()
        .map(|(index, term)| {
            let sign = if index > 0 { "+ " } else { "" };
            let what = match term.activity {
                Activity::Spin => " spinning",
                Activity::Step => "",
                Activity::Reserved => " by its deadline",
            };
            format!("{sign}{:.digits$} ({}{what})", term.share, term.component)
        })
        .collect();
    let arithmetic = words::comparison(&parts, format!("{share:.digits$}"), holds, &format!("{limit}"));
    CoreLoad {
        core,
        share,
        limit,
        verdict: match (holds, known) {
            (false, _) => Verdict::Exceeds,
            (true, false) => Verdict::NotProvable,
            (true, true) => Verdict::Holds,
        },
        terms,
        arithmetic,
    }
}

fn term(plan: &Plan, reservation: &Reservation) -> LoadTerm {
    LoadTerm {
        component: plan.components[reservation.step.component].name.clone(),
        activity: Activity::Reserved,
        cost_ns: reservation.runtime_ns,
        period_ns: reservation.period_ns,
        share: reservation.share(),
    }
}

/// Returns the load of all cores by `SCHED_DEADLINE` components; `None` if there are none.
///
/// The kernel admits at most [`RtLimit::deadline_share`] of all cores.
pub(in crate::schedule) fn deadlines(
    plan: &Plan,
    tasks: &StaticPlan,
    limit: &RtLimit,
) -> Option<DeadlineLoad> {
    let terms: Vec<LoadTerm> = tasks.reservations.iter().map(|reservation| term(plan, reservation)).collect();
    if terms.is_empty() {
        return None;
    }
    let share = terms.iter().map(|term| term.share).sum();
    let each = limit.deadline_share();
    let most = each * tasks.available_cores as f64;
    let holds = share <= most + 1e-9;
    let digits = words::shares(share, most);
    let parts: Vec<String> = terms
        .iter()
        .enumerate()
        .map(|(index, term)| {
            let sign = if index > 0 { "+ " } else { "" };
            format!("{sign}{:.digits$} ({})", term.share, term.component)
        })
        .collect();
    let most_in_words = format!("{} x {each}", tasks.available_cores);
    Some(DeadlineLoad {
        cores: tasks.available_cores,
        share,
        limit: most,
        verdict: if holds { Verdict::Holds } else { Verdict::Exceeds },
        arithmetic: words::comparison(&parts, format!("{share:.digits$}"), holds, &most_in_words),
        terms,
    })
}
