//! The result of the timing analysis of a graph.

use schemars::JsonSchema;
use serde::Serialize;

use super::{Overheads, RtLimit};
use crate::plan::ClockKind;
use crate::severity::Severity;

/// Result of the timing analysis of a graph, with its calculations as text.
///
/// Two kinds of times are unknown: the execution time of components without a budget, and releases by
/// components that are not real-time. Unknown times count as zero in all sums. A bound that nevertheless
/// exceeds its limit is refused. A bound that depends on an unknown time and is within its limit is not
/// provable.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Admission {
    /// Worst verdict of all bounds below.
    pub verdict: Verdict,
    /// Clock of the graph. In lockstep there are no deadlines, and nothing is analysed.
    pub clock: ClockKind,
    /// Overheads that the analysis assumes.
    pub overheads: Overheads,
    /// The kernel's limit on the run time of real-time threads.
    pub rt_limit: RtLimit,
    /// Load of every core with real-time components.
    pub cores: Vec<CoreLoad>,
    /// Load of all components under `SCHED_DEADLINE`, on all cores together; `null` if the graph has no such
    /// components.
    pub deadlines: Option<DeadlineLoad>,
    /// Response-time bound of every component, in the order of the plan.
    pub tasks: Vec<TaskBound>,
    /// Bound of every latency budget, in the order of the plan.
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

/// Verdict on a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Not real-time: there is no bound, and nothing is analysed.
    BestEffort,
    /// The bound is within its limit if all steps keep their budgets.
    Holds,
    /// The bound is within its limit, but depends on an unknown time.
    NotProvable,
    /// The bound exceeds its limit.
    Exceeds,
}

/// Load of the real-time components on one core.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CoreLoad {
    /// Index of the core.
    pub core: usize,
    /// Load as a fraction of the core's time, 0 to 1; a lower bound if the verdict is `not_provable`.
    pub share: f64,
    /// Fraction of the core's time that real-time threads may use before the kernel throttles them.
    pub limit: f64,
    /// Verdict on the load.
    pub verdict: Verdict,
    /// Loads of the components, which add up to `share`.
    pub terms: Vec<LoadTerm>,
    /// The sum of `terms` that yields `share`, as one line of text.
    pub arithmetic: String,
}

/// Load of the deadline-scheduled components on all cores together.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DeadlineLoad {
    /// Number of cores that the graph uses.
    pub cores: usize,
    /// Sum of the shares reserved for these components, in units of one core.
    pub share: f64,
    /// Maximum `share` that the kernel accepts, in units of one core.
    pub limit: f64,
    /// Verdict on the load.
    pub verdict: Verdict,
    /// Loads of the components, which add up to `share`.
    pub terms: Vec<LoadTerm>,
    /// The sum of `terms` that yields `share`, as one line of text.
    pub arithmetic: String,
}

/// Load of one component on its core.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LoadTerm {
    /// Name of the component.
    pub component: String,
    /// Activity for which the component uses the core.
    pub activity: Activity,
    /// Core time per period, ns.
    pub cost_ns: u64,
    /// Period, ns.
    pub period_ns: u64,
    /// `cost_ns` divided by `period_ns`.
    pub share: f64,
}

/// Activity for which a component uses its core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Activity {
    /// Spinning before a release.
    Spin,
    /// A step, including the overhead of the runtime.
    Step,
    /// The whole CPU reservation of a `SCHED_DEADLINE` component, which may run on any core and therefore
    /// counts on this core.
    Reserved,
}

/// Bound on the response time of a component, from its release to the end of its step.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TaskBound {
    /// Name of the component.
    pub component: String,
    /// Core of the component; `None` if it may run on several cores.
    pub core: Option<usize>,
    /// `SCHED_FIFO` priority; `None` if the component is not scheduled as `fifo`.
    pub priority: Option<u8>,
    /// Time between two steps, ns.
    pub period_ns: u64,
    /// Allowed execution time per step, ns; `None` if the graph sets no budget.
    pub budget_ns: Option<u64>,
    /// Maximum time for which a step waits for an answer from outside the graph without using the core, ns.
    pub waits_ns: u64,
    /// Component whose release is the start of `response_ns`: the component itself, or the first component in
    /// its trigger chain on the same core at the same priority.
    pub released_with: String,
    /// Maximum time from the release of `released_with` to the end of the step, ns; `None` if there is no
    /// bound.
    pub response_ns: Option<u64>,
    /// Maximum time from the release of the first component in the whole trigger chain to the end of the
    /// step, ns; `None` if there is no bound.
    pub chain_ns: Option<u64>,
    /// Time after its release by which the step must have ended, ns. Equal to the time from one release to
    /// the next.
    pub deadline_ns: u64,
    /// Verdict on the response time.
    pub verdict: Verdict,
    /// The sum that yields `response_ns`, as one line of text.
    pub arithmetic: String,
}

/// Bound on the latency from one topic to another.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LatencyBound {
    /// Name of the topic at the head of the chain.
    pub from: String,
    /// Name of the topic at the end of the chain.
    pub to: String,
    /// Names of the components on the path of the data, starting with the writer of `from`.
    pub path: Vec<String>,
    /// Maximum latency, ns; `None` if there is no bound.
    pub bound_ns: Option<u64>,
    /// Latency budget, ns.
    pub max_ns: u64,
    /// Verdict on the latency.
    pub verdict: Verdict,
    /// The sum that yields `bound_ns`, as one line of text.
    pub arithmetic: String,
}

/// A bound that exceeds its limit (an error) or cannot be verified (a warning).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Problem {
    /// Severity of the problem.
    pub severity: Severity,
    /// Description of the problem in one sentence.
    pub message: String,
    /// The sum that exceeds the limit, as one line of text.
    pub arithmetic: Option<String>,
    /// Advice in one sentence.
    pub advice: String,
}
