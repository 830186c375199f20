//! The report of a finished run.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CoreReport, Exit, LoggedEvent};
use crate::plan::{ClockKind, ComponentPlan, Plan};
use crate::region::{ComponentBlock, GateReport, Misses, Region, Stalls};
use crate::state::Digest;
use crate::telemetry::Percentiles;

/// Version of the report's format. It is incremented when the meaning of a field changes or a field is
/// removed.
pub const REPORT_VERSION: u32 = 2;

/// The report of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of the report's format.
    pub version: u32,
    /// Name of the graph.
    pub graph: String,
    /// Clock of the run: real time or lockstep.
    pub clock: ClockKind,
    /// Duration of the run, s; in lockstep, simulated time.
    pub duration_s: f64,
    /// Ratio of simulated time to wall-clock time; 1 in real time.
    pub realtime_factor: f64,
    /// In lockstep, digest of all published values, which is equal for equal runs; `null` in real time.
    pub state_hash: Option<String>,
    /// Episodes of the run, in order; empty if the run was not divided into episodes. In lockstep,
    /// `state_hash` and `results` of the report describe the last episode; in real time, `results` describe
    /// the whole run.
    #[serde(default)]
    pub episodes: Vec<EpisodeReport>,
    /// Outcome of the run.
    pub exit: Exit,
    /// Requests that the system denied, as text; empty if all were granted.
    pub lost: Vec<String>,
    /// Shortcomings of a run that ended normally, as text, such as components that had stopped stepping
    /// before the end or lost too many steps.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Maximum exit latency of idle states while the graph ran, ns; `null` if no limit was requested
    /// (lockstep, no real-time component) or the system denied it.
    #[serde(default)]
    pub idle_exit_ns: Option<u64>,
    /// Report of each component, in the order of the graph file.
    pub components: Vec<ComponentReport>,
    /// Report of each latency budget, in the order of the graph file.
    pub latencies: Vec<LatencyReport>,
    /// Report of each edge: a topic and one of its readers.
    pub edges: Vec<EdgeReport>,
    /// Activity that the run's components did not cause, on each core with a pinned component.
    #[serde(default)]
    pub cores: Vec<CoreReport>,
    /// Results of the components, by component name.
    pub results: BTreeMap<String, serde_json::Value>,
    /// Outcome of each expectation of the graph; empty if the run was interrupted or failed.
    #[serde(default)]
    pub expectations: Vec<ExpectationReport>,
    /// Number of events missing from `events`, because they were overwritten in the log or exceed the maximum
    /// of a report.
    #[serde(default)]
    pub events_left_out: u64,
    /// Newest events of the run, at most 256, oldest first.
    #[serde(default)]
    pub events: Vec<LoggedEvent>,
}

/// Report of one episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EpisodeReport {
    /// Index of the episode, counted from 0.
    pub index: u64,
    /// Seed of the episode. In lockstep, a run with this seed publishes the same values.
    pub seed: u64,
    /// Duration of the episode, s; in lockstep, simulated time.
    pub duration_s: f64,
    /// Number of steps of all components in the episode.
    pub steps: u64,
    /// In lockstep, digest of all values published in the episode; `null` in real time.
    pub state_hash: Option<String>,
}

/// Report of one component.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComponentReport {
    /// Name of the component in the graph.
    pub name: String,
    /// Process id of the component's last process.
    pub pid: u32,
    /// Number of completed steps.
    pub steps: u64,
    /// Number of steps per second, from the first step to the last one. If the component has stopped
    /// stepping, the time from its last step until the end of the run (or until now, during the run) is
    /// included.
    pub rate_hz: f64,
    /// Lateness, ns: time from the release or the triggering publication to the start of the step. For a step
    /// released by a file descriptor, lateness starts at the wake-up, or at the time to which `min_interval`
    /// delayed the step.
    pub lateness_ns: Percentiles,
    /// Execution time, ns of wall-clock time: from the start to the end of the step.
    pub execution_ns: Percentiles,
    /// CPU times of steps, ns, including waiting and waking but not spinning.
    pub cpu_ns: Percentiles,
    /// Time before a release at which the component started spinning, as adapted by the end of the run, ns.
    pub spin_ns: u64,
    /// Stalls of the machine, measured while the component was spinning.
    pub stalls: Stalls,
    /// Number of missed steps by cause.
    pub misses: Misses,
    /// Number of descriptor releases that came earlier than `min_interval` after the previous release and
    /// were delayed.
    #[serde(default)]
    pub deferred: u64,
    /// Number of steps that returned an error and were tolerated.
    pub errors: u64,
    /// Number of samples withheld because they were late, or refused because of their content.
    pub refused: u64,
    /// Number of restarts.
    pub restarts: u32,
    /// Statistics of an actuator's command gate; `null` for components that are not actuators.
    #[serde(default)]
    pub gate: Option<GateReport>,
    /// Number of heap allocations in steps after the first 100; `null` if the component's program does not
    /// count them.
    pub allocations: Option<u64>,
    /// Number of heap allocations by documented third-party code in steps after the first 100.
    pub allocations_apart: Option<u64>,
    /// Number of page faults of the stepping thread after the first 100 steps.
    pub page_faults: u64,
    /// `SCHED_FIFO` priority, as read back from the kernel; 0 if the class is not `SCHED_FIFO`.
    pub fifo_priority: u32,
    /// `true` if the component ran under `SCHED_DEADLINE`, as read back from the kernel.
    pub deadline: bool,
    /// True if the memory of the process was locked, as read back from the kernel.
    pub memory_locked: bool,
}

/// Report of one latency budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LatencyReport {
    /// Name of the topic at the head of the chain.
    pub from: String,
    /// Name of the topic at the end of the chain.
    pub to: String,
    /// Latency budget, ns.
    pub max_ns: u64,
    /// Latencies from the source time of `from` to the publish time of `to`, ns.
    pub latency_ns: Percentiles,
    /// Number of latencies above the budget.
    pub missed: u64,
    /// Number of measured latencies.
    pub count: u64,
}

/// Report of one edge: a topic and one of its readers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EdgeReport {
    /// Name of the topic.
    pub topic: String,
    /// Name of the component that reads the topic.
    pub reader: String,
    /// Number of samples that the component read.
    pub read: u64,
    /// Ages of samples since their publication, at the start of the step that first read them, ns; 0 in
    /// lockstep, where time does not advance within a tick.
    pub age_ns: Percentiles,
}

/// Returns the edges of a run.
pub(super) fn edges(plan: &Plan, region: &Region) -> Vec<EdgeReport> {
    plan.edges()
        .into_iter()
        .zip(region.edges())
        .map(|((topic, reader), block)| EdgeReport {
            topic: plan.topics[topic].name.clone(),
            reader: plan.components[reader].name.clone(),
            read: block.age.count(),
            age_ns: block.age.percentiles(),
        })
        .collect()
}

/// Returns the latency budgets of a run.
pub(super) fn latencies(plan: &Plan, region: &Region) -> Vec<LatencyReport> {
    plan.latencies
        .iter()
        .zip(region.latencies())
        .map(|(latency, block)| LatencyReport {
            from: plan.topics[latency.from].name.clone(),
            to: plan.topics[latency.to].name.clone(),
            max_ns: latency.max_ns,
            latency_ns: block.latency.percentiles(),
            missed: block.missed.load(Relaxed),
            count: block.latency.count(),
        })
        .collect()
}

/// Outcome of one expectation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExpectationReport {
    /// Name of the figure, such as `controller.position_error_m`.
    pub figure: String,
    /// Condition on the figure, such as `<= 0.001`.
    pub condition: String,
    /// Value of the figure; `null` if it is missing.
    pub found: serde_json::Value,
    /// True if the value satisfies the condition.
    pub met: bool,
    /// Reason why the figure has no value, as text; `null` if the figure has a value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}

impl core::fmt::Display for ExpectationReport {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { figure, condition, found, problem, .. } = self;
        match problem {
            Some(problem) => write!(f, "expected `{figure}` {condition}: {problem}"),
            None => write!(f, "expected `{figure}` {condition}, found {found}"),
        }
    }
}

/// Returns the digest of all values published in the current episode.
pub(super) fn state_hash(plan: &Plan, region: &Region) -> String {
    let mut digest = Digest::default();
    for (topic, block) in plan.topics.iter().zip(region.topics()) {
        digest.write(topic.name.as_bytes());
        digest.write_u64(block.published.load(Relaxed));
        digest.write_u64(block.digest.load(Relaxed));
    }
    format!("{:016x}", digest.finish())
}

/// Returns the steps per second of a component at `now_ns` on the run's clock.
fn rate_hz(plan: &ComponentPlan, block: &ComponentBlock, now_ns: u64) -> f64 {
    let (first, last) = (block.first_step_ns.load(Relaxed), block.last_step_ns.load(Relaxed));
    let begun = block.begun.load(Relaxed).saturating_sub(block.episode_first.load(Relaxed));
    steps_per_second(begun, first, last, now_ns, plan.period_ns())
}

/// Returns the rate of a component, in steps per second, from the number of steps begun and the time between
/// the first and the last step. If the last step is more than two periods old, the time from the first step
/// until `now_ns` is used, so that the rate of a stopped component falls. All times are in ns.
pub fn steps_per_second(begun: u64, first_ns: u64, last_ns: u64, now_ns: u64, period_ns: u64) -> f64 {
    let still_steps = now_ns.saturating_sub(last_ns) <= 2 * period_ns;
    let end_ns = if still_steps { last_ns } else { now_ns };
    let span_ns = end_ns.saturating_sub(first_ns);
    if begun > 1 && span_ns > 0 { (begun - 1) as f64 * 1e9 / span_ns as f64 } else { 0.0 }
}

/// Returns the report of a component, from its counters.
pub(super) fn component(plan: &ComponentPlan, block: &ComponentBlock, now_ns: u64) -> ComponentReport {
    let counts = block.counts_allocations.load(Relaxed) != 0;
    ComponentReport {
        name: plan.name.clone(),
        pid: block.pid.load(Relaxed),
        steps: block.steps.load(Relaxed),
        rate_hz: rate_hz(plan, block, now_ns),
        lateness_ns: block.lateness.percentiles(),
        execution_ns: block.execution.percentiles(),
        cpu_ns: block.cpu.percentiles(),
        spin_ns: block.spin_ns.load(Relaxed),
        stalls: block.stalls(),
        misses: block.misses(),
        deferred: block.deferred.load(Relaxed),
        errors: block.errors.load(Relaxed),
        refused: block.refused.load(Relaxed),
        restarts: block.restarts.load(Relaxed),
        gate: block.gate.report(),
        allocations: counts.then(|| block.allocations.load(Relaxed)),
        allocations_apart: counts.then(|| block.allocations_apart.load(Relaxed)),
        page_faults: block.page_faults.load(Relaxed),
        fifo_priority: block.fifo_priority.load(Relaxed),
        deadline: block.deadline.load(Relaxed) != 0,
        memory_locked: block.memory_locked.load(Relaxed) != 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn rate_does_not_depend_on_the_time_of_reading() {
        for now in [10_000_000_000, 10_000_900_000, 10_001_900_000] {
            assert_eq!(steps_per_second(9_001, S, 10 * S, now, 1_000_000), 1_000.0);
        }
    }

    #[test]
    fn rate_of_a_stopped_component_falls() {
        assert_eq!(steps_per_second(1_001, S, 2 * S, 5 * S, 1_000_000), 250.0);
        assert_eq!(steps_per_second(0, 0, 0, 5 * S, 1_000_000), 0.0);
        assert_eq!(steps_per_second(1, S, S, 5 * S, 1_000_000), 0.0);
    }
}
