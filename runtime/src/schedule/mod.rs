//! Timing analysis of a plan: bounds on the response times of components and on latencies, as pure functions.
//!
//! [`admit`] is the check before a launch. Its model of the machine and its assumptions are:
//!
//! * Real-time components are `SCHED_FIFO` threads on one core each, or `SCHED_DEADLINE` threads. The latter
//!   run ahead of all priorities and on any core; each core is assumed to run all of them. Components that
//!   trigger one another on one core at one priority are one task ([`StaticPlan`]); the response time of each
//!   of its stages is bounded, across cores and priorities by release jitter.
//! * Phases are considered: tasks on the common clock whose releases never coincide do not delay each other.
//!   A component with the overrun policy `rephase` may leave the clock and is assumed to be released at any
//!   time.
//! * A component that spins before a release occupies its core. Only components of higher priority can run.
//! * Budgets are kept. Budget overruns, stolen time, interrupts and non-preemptible kernel sections are
//!   outside the model; they are counted by cause at run time.
//! * Equal priorities: a chain ahead in the queue is counted as a whole. A component released by the clock
//!   moves to the end of the queue again when it first gets the core, so that components which a publication
//!   has woken in the meantime run first.
//! * A component publishes at the end of its step (this only matters for latencies). The worker's subsequent
//!   work delays components triggered on its core, unless they are more urgent.
//! * A step that sleeps while it waits for an external answer ([`waits`](crate::declare::Declare::waits))
//!   takes longer by the waiting time, but only occupies the core for its budget.
//! * An unknown time counts as zero, and every bound that depends on it is not provable.
//!
//! [`timeline()`] simulates one hyperperiod in which all budgets are used up and no step waits for answers.
//! [`assign`] chooses priorities and cores that a graph does not specify.

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

/// Analyses whether a graph meets its deadlines and latency budgets on a machine with these overheads and
/// this limit on real-time threads.
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
    let tasks = StaticPlan::from_plan(plan, overheads);
    let responses = response::responses(&tasks, overheads);
    let unknown = Unknown::from_plan(plan, &tasks);
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
