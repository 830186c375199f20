//! The analysis of a plan's times: a static plan, response times, latencies; pure functions without a clock.
//!
//! [`admit`] is the check before a launch. Its model, and what it rests on:
//!
//! * Real-time components are `SCHED_FIFO` threads on one core each, or scheduled by their deadlines: these run before
//!   all priorities, on any core; each core is taken to have all of them. Those that trigger one another on a core at a
//!   priority are one task ([`StaticPlan`]); the response time of every stage of it is bounded, across cores and
//!   priorities through release jitter.
//! * Phases count: tasks on the common clock that never meet do not hold each other up. A component with the overrun
//!   policy `rephase` may leave the clock; it is taken to be released at any time.
//! * Spinning before a release takes the core from everything that is not more urgent.
//! * Budgets are kept. A component that outruns its budget, a host that steals time, interrupts, and a kernel that
//!   cannot be interrupted are no part of the model: they show while the graph runs, counted by cause.
//! * Equal priorities: a chain that is ahead in the queue is counted whole. What waits for the clock goes to the end of
//!   the queue once more as it gets the core, so that those which a publication woke meanwhile come first.
//! * A component publishes at the end of its step (matters for latencies only). What the worker does after that holds
//!   up those that are triggered on its core, unless they are more urgent.
//! * What is not known counts as nothing, and what rests on it as not provable.
//!
//! [`timeline()`] draws up one hyperperiod as it runs when all budgets are used up. [`assign`] gives priorities and
//! cores to components for which a graph does not.

mod admission;
pub mod assign;
mod global;
mod latency;
mod load;
mod overheads;
mod phases;
mod problems;
mod response;
mod tasks;
mod terms;
mod timeline;
mod unknown;
mod window;
mod words;

#[cfg(test)]
pub(crate) mod tests;

pub use admission::{
    Activity, Admission, CoreLoad, DeadlineLoad, LatencyBound, LoadTerm, Problem, TaskBound, Verdict,
};
pub use overheads::{Overheads, RtLimit};
pub use tasks::{Place, Release, Reservation, Stage, StaticPlan, Step, Task};
pub use timeline::{CoreTimeline, Lane, Segment, Timeline, timeline};

use crate::plan::{ClockKind, Plan};
use latency::Analysis;
use unknown::Unknown;

/// Finds out whether a graph can hold its times on a machine with these overheads and this limit for real-time threads.
pub fn admit(plan: &Plan, overheads: &Overheads, rt_limit: RtLimit) -> Admission {
    let mut admission = Admission {
        verdict: Verdict::BestEffort,
        clock: plan.clock,
        overheads: *overheads,
        rt_limit,
        cores: Vec::new(),
        deadlines: None,
        tasks: Vec::new(),
        latencies: Vec::new(),
        problems: Vec::new(),
    };
    if plan.clock == ClockKind::Lockstep {
        return admission;
    }
    let tasks = StaticPlan::of(plan, overheads);
    let responses = response::responses(&tasks, overheads);
    let unknown = Unknown::of(plan, &tasks);
    let analysis = Analysis { plan, tasks: &tasks, responses: &responses, unknown: &unknown };
    admission.cores =
        tasks.cores().into_iter().map(|core| load::load(plan, &tasks, core, &rt_limit)).collect();
    admission.deadlines = load::deadlines(plan, &tasks, &rt_limit);
    admission.tasks = (0..plan.components.len()).map(|component| bound(&analysis, component)).collect();
    admission.latencies = plan.latencies.iter().map(|latency| latency::latency(&analysis, latency)).collect();
    problems::find(&analysis, &mut admission);
    let verdicts = (admission.cores.iter().map(|core| core.verdict))
        .chain(admission.deadlines.iter().map(|deadlines| deadlines.verdict))
        .chain(admission.tasks.iter().map(|task| task.verdict))
        .chain(admission.latencies.iter().map(|latency| latency.verdict));
    admission.verdict = verdicts.max().unwrap_or(Verdict::BestEffort);
    admission
}

/// The bound of one component.
fn bound(analysis: &Analysis<'_>, component: usize) -> TaskBound {
    let (plan, tasks) = (analysis.plan, analysis.tasks);
    let planned = &plan.components[component];
    let deadline_ns = planned.period_ns();
    let mut found = TaskBound {
        component: planned.name.clone(),
        core: tasks::core(plan, planned),
        priority: tasks::priority(planned),
        period_ns: planned.period_ns(),
        budget_ns: planned.budget_ns,
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
    // a time-triggered component is measured from its release, not from where it begins to spin
    let (sum, spin) = match task.release {
        Release::Timer { spin_ns, .. } => (&bound.finish, spin_ns as i64),
        Release::Trigger { .. } => (&bound.response, 0),
    };
    let response = u64::try_from(sum.total - spin).unwrap_or(0);
    let holds = response <= deadline_ns;
    let known = !analysis.unknown.rests[place.task];
    let terms: Vec<String> = terms::of(analysis, place, 0, sum)
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

/// The bound of a component that the kernel schedules by its deadline.
fn by_deadline(
    analysis: &Analysis<'_>,
    index: usize,
    reservation: &Reservation,
    mut found: TaskBound,
) -> TaskBound {
    let (cost, runtime) = (reservation.step.cost_ns(), reservation.runtime_ns);
    let deadline = words::time(found.deadline_ns);
    found.verdict = Verdict::Exceeds;
    if cost > runtime {
        found.arithmetic =
            format!("{} > {} that the kernel gives it", words::time(cost), words::time(runtime));
        return found;
    }
    let responses = analysis.responses;
    let (Some(response), Some(finish)) = (
        responses.reserved_response[index],
        responses.reserved_finish(index).and_then(|ns| u64::try_from(ns).ok()),
    ) else {
        found.arithmetic = format!("not in time for certain beside the other deadlines > {deadline}");
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
