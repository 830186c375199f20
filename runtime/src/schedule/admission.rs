//! The result of an admission.

use schemars::JsonSchema;
use serde::Serialize;

use super::{Overheads, RtLimit};
use crate::plan::ClockKind;
use crate::severity::Severity;

/// Result of the timing analysis of a graph, with the arithmetic.
///
/// Unknown times (components without a budget, releases by components that are not real-time) count as zero
/// in all sums. A bound that still exceeds its limit is refused; a bound that holds but depends on an unknown
/// time is not provable.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Admission {
    /// The worst verdict of all bounds below.
    pub verdict: Verdict,
    /// Clock of the graph. In lockstep there are no deadlines, and nothing is analysed.
    pub clock: ClockKind,
    /// The overheads assumed.
    pub overheads: Overheads,
    /// The kernel's limit on real-time threads.
    pub rt_limit: RtLimit,
    /// Every core with real-time components.
    pub cores: Vec<CoreLoad>,
    /// The load of the components under `SCHED_DEADLINE`, on all cores together; `null` if the graph has
    /// none.
    pub deadlines: Option<DeadlineLoad>,
    /// Every component, in the order of the plan.
    pub tasks: Vec<TaskBound>,
    /// Every latency budget, in the order of the plan.
    pub latencies: Vec<LatencyBound>,
    /// Bounds that do not hold or cannot be verified.
    pub problems: Vec<Problem>,
}

impl Admission {
    /// Returns `true` if the graph must not run because a bound does not hold.
    pub fn refuses(&self) -> bool {
        self.verdict == Verdict::Exceeds
    }

    /// Returns the bounds that do not hold.
    pub fn refusals(&self) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(|problem| problem.severity == Severity::Error)
    }
}

/// The verdict on a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Not real-time: no bound, and no analysis.
    BestEffort,
    /// The bound holds as long as all steps keep their budgets.
    Holds,
    /// The bound is within its limit, but depends on an unknown time.
    NotProvable,
    /// The bound exceeds its limit.
    Exceeds,
}

/// The load of real-time components on a core.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CoreLoad {
    /// The core.
    pub core: usize,
    /// Share of its time, 1 for all of it; at least that much if the verdict is `not_provable`.
    pub share: f64,
    /// Share that real-time threads may use before the kernel throttles them.
    pub limit: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// The terms of the share.
    pub terms: Vec<LoadTerm>,
    /// The sum in one line.
    pub arithmetic: String,
}

/// Load of the deadline-scheduled components on all cores together.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DeadlineLoad {
    /// Number of cores of the graph.
    pub cores: usize,
    /// Total reserved share, in units of one core.
    pub share: f64,
    /// Maximum accepted by the kernel.
    pub limit: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// The terms of the share.
    pub terms: Vec<LoadTerm>,
    /// The sum in one line.
    pub arithmetic: String,
}

/// The load of one component on its core.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LoadTerm {
    /// Name of the component.
    pub component: String,
    /// The use of the time.
    pub activity: Activity,
    /// Time per period, ns.
    pub cost_ns: u64,
    /// The period, ns.
    pub period_ns: u64,
    /// `time_ns` divided by `period_ns`.
    pub share: f64,
}

/// A component's use of a core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Activity {
    /// Spinning before its release.
    Spin,
    /// Its step, including the overhead of the runtime.
    Step,
    /// The whole reservation of a `SCHED_DEADLINE` component that may run on this core.
    Reserved,
}

/// Bound on the time of a component from its release to the end of its step.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TaskBound {
    /// Name of the component.
    pub component: String,
    /// Core; `None` if it may run on several.
    pub core: Option<usize>,
    /// `SCHED_FIFO` priority; `None` if not real-time.
    pub priority: Option<u8>,
    /// Time between two of its steps, ns.
    pub period_ns: u64,
    /// Execution time allowed per step, ns.
    pub budget_ns: Option<u64>,
    /// Longest time for which a step waits for an answer without the core, ns.
    pub waits_ns: u64,
    /// Component at whose release `response_ns` starts: itself, or the head of its trigger chain on the same
    /// core at the same priority.
    pub released_with: String,
    /// Longest time from that release to the end of the step, ns. `None` without a bound.
    pub response_ns: Option<u64>,
    /// Longest time from the release of the time-triggered component at the head of the whole chain, ns.
    pub chain_ns: Option<u64>,
    /// Time until the next release, ns, by which the step must have ended.
    pub deadline_ns: u64,
    /// The verdict.
    pub verdict: Verdict,
    /// The sum of `response_ns`, in one line.
    pub arithmetic: String,
}

/// Bound on the latency of data from one topic to another.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LatencyBound {
    /// Topic at the head of the chain.
    pub from: String,
    /// Topic at its end.
    pub to: String,
    /// Components on the path of the data, the writer of `from` first.
    pub path: Vec<String>,
    /// Longest time, ns. `None` without a bound.
    pub bound_ns: Option<u64>,
    /// Longest time allowed, ns.
    pub max_ns: u64,
    /// The verdict.
    pub verdict: Verdict,
    /// The sum of `bound_ns`, in one line.
    pub arithmetic: String,
}

/// A bound that does not hold (an error) or cannot be verified (a warning).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Problem {
    /// The severity.
    pub severity: Severity,
    /// The problem, in one sentence.
    pub message: String,
    /// The sum behind it, in one line.
    pub arithmetic: Option<String>,
    /// Advice, in one sentence.
    pub advice: String,
}
