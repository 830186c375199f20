//! The analysis of a plan's times: a static plan, response times, latencies; pure functions without a clock.
//!
//! [`admit`] is the check before a launch. Its model and its assumptions:
//!
//! * Real-time components are `SCHED_FIFO` threads on one core each, or `SCHED_DEADLINE` threads. The latter run before
//!   all priorities, on any core; each core is assumed to run all of them. Components that trigger one another on one
//!   core at one priority are one task ([`StaticPlan`]); the response time of every stage of it is bounded, across
//!   cores and priorities through release jitter.
//! * Phases count: tasks on the common clock whose releases never meet do not delay each other. A component with the
//!   overrun policy `rephase` may leave the clock; it is assumed to be released at any time.
//! * Spinning before a release occupies the core against everything that is not more urgent.
//! * Budgets are kept. A component that exceeds its budget, a host that steals time, interrupts, and a kernel that
//!   cannot be preempted are outside the model: they are counted by cause while the graph runs.
//! * Equal priorities: a chain that is ahead in the queue is counted whole. A component that waits for the clock goes
//!   to the end of the queue once more when it first gets the core, so that components which a publication woke
//!   meanwhile run first.
//! * A component publishes at the end of its step (this matters for latencies only). The worker's own work after that
//!   delays the components that are triggered on its core, unless they are more urgent.
//! * A step that waits for an answer from outside without the core ([`waits`](crate::declare::Declare::waits)) takes that long
//!   itself, and the core from others for its budget only.
//! * An unknown time counts as zero, and every bound that rests on it as not provable.
//!
//! [`timeline()`] simulates one hyperperiod in which all budgets are used up, and no answer is waited for. [`assign`] chooses the priorities and
//! cores that a graph leaves open.

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
