//! How busy real-time components keep a core, and whether the kernel would stop them.

use super::admission::{Activity, CoreLoad, LoadTerm, Verdict};
use super::response::Responses;
use super::tasks::StaticPlan;
use super::{RtLimit, words};
use crate::plan::Plan;

/// Load of one core.
pub(super) fn load(plan: &Plan, tasks: &StaticPlan, core: usize, limit: &RtLimit) -> CoreLoad {
    let mut terms = Vec::new();
    let mut known = !plan.components.iter().any(super::tasks::has_deadline);
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
            let spins = if term.activity == Activity::Spin { " spinning" } else { "" };
            format!("{sign}{:.digits$} ({}{spins})", term.share, term.component)
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

/// The longest time, ns, that real-time components may run within one throttling period, with the terms of the sum.
/// `None` if there is no throttling, or no bound.
///
/// The share of a core is a mean; the kernel counts in periods. In a window of length P a task of cost C, period T and
/// response time R runs for at most `n * C + min(C, P + R - C - n * T)` with `n = floor((P + R - C) / T)`: its first job
/// as late as it can be, its last one at once (M. Bertogna, M. Cirinei, G. Lipari 2005).
pub(super) fn longest_burst(
    tasks: &StaticPlan,
    responses: &Responses,
    core: usize,
    limit: &RtLimit,
) -> Option<(u64, Vec<(usize, u64)>)> {
    limit.runtime_ns?;
    let window = limit.period_ns as i64;
    let terms: Option<Vec<(usize, u64)>> = tasks
        .on_core(core)
        .into_iter()
        .map(|index| {
            let bounds = responses.bounds[index].as_ref()?;
            let (cost, period) = (responses.demands[index].cost(), responses.demands[index].period);
            let response = bounds.iter().map(|bound| bound.response.total).max()?;
            let span = (window + response - cost).max(0);
            let whole = span / period;
            let work = whole * cost + cost.min(span - whole * period);
            Some((index, u64::try_from(work.min(window)).unwrap_or(0)))
        })
        .collect();
    let terms = terms?;
    Some((terms.iter().map(|(_, work)| work).sum(), terms))
}
