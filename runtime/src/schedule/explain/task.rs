//! Bounds on response times, with their sums as text.

use super::{terms, words};
use crate::schedule::admission::{TaskBound, Verdict};
use crate::schedule::analysis::tasks::{self, Release, Reservation};
use crate::schedule::analysis::{Analysis, latency};

/// Returns the bound of one component.
pub(in crate::schedule) fn bound(analysis: &Analysis<'_>, component: usize) -> TaskBound {
    let (plan, tasks) = (analysis.plan, analysis.tasks);
    let planned = &plan.components[component];
    let deadline_ns = planned.period_ns();
    let mut found = TaskBound {
        component: planned.name.clone(),
        core: tasks::core(plan, planned),
        priority: tasks::priority(planned),
        period_ns: planned.period_ns(),
        budget_ns: planned.budget_ns,
        waits_ns: planned.waits_ns,
        released_with: planned.name.clone(),
        response_ns: None,
        chain_ns: None,
        deadline_ns,
        verdict: Verdict::BestEffort,
        arithmetic: "not real-time".to_string(),
    };
    if let Some((index, reservation)) = tasks.reservation(component) {
        return by_deadline(analysis, index, reservation, found);
    }
    let Some(place) = tasks.places[component] else {
        if found.priority.is_some() {
            found.verdict = Verdict::NotProvable;
            found.arithmetic = "may run on several cores".to_string();
        }
        return found;
    };
    let task = &tasks.tasks[place.task];
    found.released_with.clone_from(&plan.components[task.head()].name);
    let bound = analysis.responses.bounds[place.task].as_ref().and_then(|stages| stages.get(place.stage));
    let Some(bound) = bound else {
        found.verdict = Verdict::Exceeds;
        found.arithmetic = format!("grows without bound > {}", words::time(deadline_ns));
        return found;
    };
    // the head of a chain is measured from its release, not from the start of its spinning or its wake-up
    let (sum, spin) = match task.release {
        Release::Timer { spin_ns, .. } => (&bound.finish, spin_ns as i64),
        Release::Event => (&bound.finish, 0),
        Release::Trigger { .. } => (&bound.response, 0),
    };
    let response = u64::try_from(sum.total - spin).unwrap_or(0);
    let holds = response <= deadline_ns;
    let known = !analysis.unknown.rests[place.task];
    let terms: Vec<String> = terms::bound_terms(analysis, place, 0, sum)
        .iter()
        .enumerate()
        .map(|(index, term)| terms::joined(index, term))
        .collect();
    found.response_ns = Some(response);
    found.chain_ns = latency::since_release(analysis, component);
    found.verdict = match (holds, known) {
        (false, _) => Verdict::Exceeds,
        (true, false) => Verdict::NotProvable,
        (true, true) => Verdict::Holds,
    };
    found.arithmetic = words::comparison(&terms, words::time(response), holds, &words::time(deadline_ns));
    found
}

/// Returns the bound of a component under `SCHED_DEADLINE`.
fn by_deadline(
    analysis: &Analysis<'_>,
    index: usize,
    reservation: &Reservation,
    mut found: TaskBound,
) -> TaskBound {
    let (cost, runtime) = (reservation.step.cost_ns(), reservation.runtime_ns);
    let deadline = words::time(found.deadline_ns);
    if reservation.step.waits_ns > 0 {
        found.verdict = Verdict::NotProvable;
        found.arithmetic =
            "waits for an answer, after which the kernel may give it a later deadline".to_string();
        return found;
    }
    found.verdict = Verdict::Exceeds;
    if cost > runtime {
        found.arithmetic = format!("{} > {} that the kernel grants", words::time(cost), words::time(runtime));
        return found;
    }
    let responses = analysis.responses;
    let (Some(response), Some(finish)) = (
        responses.reserved_response[index],
        responses.reserved_finish(index).and_then(|ns| u64::try_from(ns).ok()),
    ) else {
        found.arithmetic = format!("not guaranteed to be in time with the other deadlines > {deadline}");
        return found;
    };
    let holds = finish <= found.deadline_ns;
    let mut terms = vec![format!("{} ({})", words::time(cost), found.component)];
    let mut add = |ns: u64, what: &str| {
        if ns > 0 {
            terms.push(format!("+ {} ({what})", words::time(ns)));
        }
    };
    add(u64::try_from(response).unwrap_or(0).saturating_sub(cost), "others by their deadlines");
    add(u64::try_from(responses.reserved_late).unwrap_or(0), "released late");
    found.response_ns = Some(finish);
    found.chain_ns = Some(finish);
    if holds {
        found.verdict = if found.budget_ns.is_some() { Verdict::Holds } else { Verdict::NotProvable };
    }
    found.arithmetic = words::comparison(&terms, words::time(finish), holds, &deadline);
    found
}
