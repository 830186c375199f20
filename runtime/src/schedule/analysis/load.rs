//! The longest burst of real-time components on a core.

use super::overheads::RtLimit;
use super::response::Responses;
use super::tasks::StaticPlan;
use super::window::Demand;

/// The longest time that real-time components may run within one throttling period.
#[derive(Debug)]
pub(in crate::schedule) struct Burst {
    /// Total time, ns.
    pub total_ns: u64,
    /// Components of each task or reservation, and their maximum time on the core, ns.
    pub terms: Vec<(Vec<usize>, u64)>,
}

/// Returns the longest time that real-time components may run within one throttling period, ns, with the
/// terms of the sum. Returns `None` without throttling or without a bound.
///
/// The share of a core is a mean, but the kernel counts in periods. In a window of length P a task of cost C,
/// period T and response time R runs for at most `n * C + min(C, P + R - C - n * T)` with
/// `n = floor((P + R - C) / T)`. Its first job runs as late as possible, its last one immediately (M.
/// Bertogna, M. Cirinei, G. Lipari 2005).
pub(in crate::schedule) fn longest_burst(
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
