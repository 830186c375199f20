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
mod analysis;
mod explain;
mod neighbours;
mod timeline;

#[cfg(test)]
pub(crate) mod tests;

pub use admission::{
    Activity, Admission, CoreLoad, DeadlineLoad, LatencyBound, LoadTerm, Problem, TaskBound, Verdict,
};
pub use analysis::assign;
pub use analysis::overheads::{Overheads, RtLimit};
pub use analysis::tasks::{Place, Release, Reservation, Stage, StaticPlan, Step, Task};
pub use neighbours::beside;
pub use timeline::{CoreTimeline, Lane, Segment, Timeline, timeline};

use crate::plan::{ClockKind, Plan};
use analysis::unknown::Unknown;
use analysis::{Analysis, response};
use explain::{latency, load, problems, task};

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
    admission.tasks = (0..plan.components.len()).map(|component| task::bound(&analysis, component)).collect();
    admission.latencies = plan.latencies.iter().map(|latency| latency::latency(&analysis, latency)).collect();
    problems::find(&analysis, &mut admission);
    let verdicts = (admission.cores.iter().map(|core| core.verdict))
        .chain(admission.deadlines.iter().map(|deadlines| deadlines.verdict))
        .chain(admission.tasks.iter().map(|task| task.verdict))
        .chain(admission.latencies.iter().map(|latency| latency.verdict));
    admission.verdict = verdicts.max().unwrap_or(Verdict::BestEffort);
    admission
}
