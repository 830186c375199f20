//! The load of real-time components on a core, against the kernel's limit.

use super::admission::{Activity, CoreLoad, DeadlineLoad, LoadTerm, Verdict};
use super::response::Responses;
use super::tasks::{Reservation, StaticPlan};
use super::window::Demand;
use super::{RtLimit, words};
use crate::plan::Plan;

/// Load of one core.
pub(super) fn load(plan: &Plan, tasks: &StaticPlan, core: usize, limit: &RtLimit) -> CoreLoad {
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
    // what is scheduled by deadlines may all run here
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

/// Load on all cores of all components that are scheduled by deadlines; `None` if there are none.
///
/// The kernel takes no more than [`RtLimit::deadline_share`] of all cores.
pub(super) fn deadlines(plan: &Plan, tasks: &StaticPlan, limit: &RtLimit) -> Option<DeadlineLoad> {
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

/// The longest time that real-time components may run within one throttling period.
#[derive(Debug)]
pub(super) struct Burst {
    /// In all, ns.
    pub total_ns: u64,
    /// By task or reservation: its components, and how long they run, ns.
    pub terms: Vec<(Vec<usize>, u64)>,
}

/// The longest time, ns, that real-time components may run within one throttling period, with the terms of the sum,
/// each by its components. `None` if there is no throttling, or no bound.
///
/// The share of a core is a mean; the kernel counts in periods. In a window of length P a task of cost C, period T and
/// response time R runs for at most `n * C + min(C, P + R - C - n * T)` with `n = floor((P + R - C) / T)`: its first
/// job as late as it can be, its last one at once (M. Bertogna, M. Cirinei, G. Lipari 2005).
pub(super) fn longest_burst(
    tasks: &StaticPlan,
    responses: &Responses,
    core: usize,
    limit: &RtLimit,
) -> Option<Burst> {
    limit.runtime_ns?;
    let window = limit.period_ns as i64;
    let work = |demand: &Demand, response: i64| {
        let (cost, period) = (demand.cost(), demand.period);
        let span = (window + response - cost).max(0);
        let whole = span / period;
        let work = whole * cost + cost.min(span - whole * period);
        u64::try_from(work.min(window)).unwrap_or(0)
    };
    let of_tasks = tasks.on_core(core).into_iter().map(|index| {
        let response = responses.bounds[index].as_ref()?.iter().map(|bound| bound.response.total).max()?;
        let members = tasks.tasks[index].steps().map(|step| step.component).collect();
        Some((members, work(&responses.demands[index], response)))
    });
    let of_reservations = tasks.reservations.iter().zip(&responses.reserved).map(|(reservation, demand)| {
        let response = demand.jitter? + demand.cost();
        Some((vec![reservation.step.component], work(demand, response)))
    });
    let terms: Option<Vec<(Vec<usize>, u64)>> = of_tasks.chain(of_reservations).collect();
    let terms = terms?;
    Some(Burst { total_ns: terms.iter().map(|(_, work)| work).sum(), terms })
}
