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

/// Version of the report's format; incremented when the meaning of a field changes or a field is removed.
pub const REPORT_VERSION: u32 = 2;

/// The report of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of this format.
    pub version: u32,
    /// Name of the graph.
    pub graph: String,
    /// The clock of the run.
    pub clock: ClockKind,
    /// Duration of the run, s: simulated time in lockstep.
    pub duration_s: f64,
    /// Simulated time per wall-clock time; 1 in real time.
    pub realtime_factor: f64,
    /// Digest of all published values in lockstep, equal for equal runs; `null` in real time.
    pub state_hash: Option<String>,
    /// Episodes of a run that was divided, in order. In lockstep, `state_hash` and `results` are from the
    /// last episode; in real time, `results` are from the whole run.
    #[serde(default)]
    pub episodes: Vec<EpisodeReport>,
    /// The end of the run.
    pub exit: Exit,
    /// Requests denied by the system, as text; empty if all were granted.
    pub lost: Vec<String>,
    /// Shortcomings of a run that ended normally, as text: components that no longer stepped at the end, or
    /// lost too many steps.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Maximum exit latency of idle states while the graph ran, ns; `null` if no limit was requested
    /// (lockstep, no real-time component) or the system denied it.
    #[serde(default)]
    pub idle_exit_ns: Option<u64>,
    /// Each component, in the order of the graph file.
    pub components: Vec<ComponentReport>,
    /// Each latency budget, in the order of the graph file.
    pub latencies: Vec<LatencyReport>,
    /// Each topic and each of its readers.
    pub edges: Vec<EdgeReport>,
    /// Other activity of each core with a pinned component.
    #[serde(default)]
    pub cores: Vec<CoreReport>,
    /// Results of the components, by name.
    pub results: BTreeMap<String, serde_json::Value>,
    /// Result of each expectation of the graph; empty for a run that was interrupted or failed.
    #[serde(default)]
    pub expectations: Vec<ExpectationReport>,
    /// Number of events missing from `events`: overwritten in the log, or beyond the maximum of a report.
    #[serde(default)]
    pub events_left_out: u64,
    /// The newest events of the run, at most 256, oldest first.
    #[serde(default)]
    pub events: Vec<LoggedEvent>,
}

/// One episode in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EpisodeReport {
    /// Its number, from 0.
    pub index: u64,
    /// Its seed; in lockstep, a run with this seed publishes the same values.
    pub seed: u64,
    /// Time from its start to its end, s: simulated in lockstep.
    pub duration_s: f64,
    /// Steps of all components in it.
    pub steps: u64,
    /// Digest of all values published in it in lockstep; `null` in real time.
    pub state_hash: Option<String>,
}

/// One component in the report.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComponentReport {
    /// Its name in the graph.
    pub name: String,
    /// Process id of its last process.
    pub pid: u32,
    /// Steps done.
    pub steps: u64,
    /// Steps per second from its first step to the end of the run, or until now if it no longer steps.
    pub rate_hz: f64,
    /// Lateness: from the release or the triggering publication to the start of the step, ns. For a release
    /// by a descriptor, from its wake-up or from the time to which `min_interval` deferred it.
    pub lateness_ns: Percentiles,
    /// Execution time: from the start to the end of the step, wall-clock ns.
    pub execution_ns: Percentiles,
    /// CPU times of steps, ns, including waiting and waking but not spinning.
    pub cpu_ns: Percentiles,
    /// Spin time before a release, as of the end of the run, ns.
    pub spin_ns: u64,
    /// Stalls of the machine during its spinning.
    pub stalls: Stalls,
    /// Number of missed steps by cause.
    pub misses: Misses,
    /// Number of descriptor releases that came earlier than `min_interval` after the previous one and were
    /// delayed.
    #[serde(default)]
    pub deferred: u64,
    /// Number of steps that returned an error and were tolerated.
    pub errors: u64,
    /// Number of samples withheld because they were late, or refused because of their content.
    pub refused: u64,
    /// Restarts.
    pub restarts: u32,
    /// The account of an actuator's command gate; `null` for other components.
    #[serde(default)]
    pub gate: Option<GateReport>,
    /// Heap allocations in steps after the first 100; `null` if its program does not count them.
    pub allocations: Option<u64>,
    /// Heap allocations after the first 100 steps by documented foreign code.
    pub allocations_apart: Option<u64>,
    /// Page faults of its thread after the first 100 steps.
    pub page_faults: u64,
    /// `SCHED_FIFO` priority, read back; 0 for any other class.
    pub fifo_priority: u32,
    /// `true` if it ran under `SCHED_DEADLINE`, read back.
    pub deadline: bool,
    /// True if its memory was locked, read back.
    pub memory_locked: bool,
}

/// One latency budget in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LatencyReport {
    /// Topic at the head of the chain.
    pub from: String,
    /// Topic at its end.
    pub to: String,
    /// The budget, ns.
    pub max_ns: u64,
    /// Latency from the source time of `from` to the publish time of `to`, ns.
    pub latency_ns: Percentiles,
    /// Number of measurements above the budget.
    pub missed: u64,
    /// Number of measurements.
    pub count: u64,
}

/// A topic and one of its readers in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EdgeReport {
    /// The topic.
    pub topic: String,
    /// The component that reads it.
    pub reader: String,
    /// Number of samples it read.
    pub read: u64,
    /// Age of each sample since its publication, at the start of the step that first read it, ns; 0 in
    /// lockstep, where a tick takes no time.
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

/// One expectation in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExpectationReport {
    /// The figure, such as `controller.position_error_m`.
    pub figure: String,
    /// The condition, such as `<= 0.001`.
    pub condition: String,
    /// Value of the figure; `null` if missing.
    pub found: serde_json::Value,
    /// True if the value satisfies the condition.
    pub met: bool,
    /// The reason for a figure without a value, as text.
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

/// Returns the steps per second, from the number of steps and the time between the first and the last step.
/// If the last step is more than two periods old, the time until `now_ns` is used, so that the rate of a
/// stopped component falls. All times are in ns.
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
