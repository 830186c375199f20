//! The data of `motorium top`: printed by `--json`, shown by its tables.

use motorium::launcher::LoggedEvent;
use motorium::plan::ClockKind;
use motorium::region::{GateReport, Misses, Phase, Stalls};
use motorium::telemetry::Percentiles;
use schemars::JsonSchema;
use serde::Serialize;

/// Version of this format; incremented when the meaning of a field changes or a field is removed.
pub(crate) const TOP_VERSION: u32 = 1;

/// State and timing of a running graph.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Top {
    /// Version of this format.
    pub(crate) version: u32,
    /// Id of the run.
    pub(crate) run: String,
    /// Name of the graph.
    pub(crate) graph: String,
    /// Clock of the run: real time or lockstep.
    pub(crate) clock: ClockKind,
    /// State of the graph.
    pub(crate) state: State,
    /// Time since the start of the run on the run's clock, s; 0 before the start.
    pub(crate) elapsed_s: f64,
    /// Wall-clock length of the interval that the `interval` fields cover, s.
    pub(crate) interval_s: f64,
    /// State and timing of each component, in the order of the graph file.
    pub(crate) components: Vec<ComponentTop>,
    /// Measurements of each latency budget, in the order of the graph file.
    pub(crate) latencies: Vec<LatencyTop>,
    /// Measurements of each edge: a topic and one of its readers.
    pub(crate) edges: Vec<EdgeTop>,
    /// Use of each core of the machine.
    pub(crate) cores: Vec<CoreTop>,
    /// The newest events of the run, at most five, oldest first.
    pub(crate) events: Vec<LoggedEvent>,
}

/// State of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    /// The components are being configured and connected.
    Starting,
    /// The components step.
    Running,
    /// The actuators apply the safe state.
    SafeStop,
    /// The run has received a request to end.
    Stopping,
}

/// State and timing of one component.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct ComponentTop {
    /// Name of the component in the graph.
    pub(crate) name: String,
    /// Phase of the component's life.
    pub(crate) phase: Phase,
    /// `true` for an actuator in its safe state.
    pub(crate) safe: bool,
    /// Statistics of an actuator's command gate over the whole run; `null` for other components.
    pub(crate) gate: Option<GateReport>,
    /// Process id of the component.
    pub(crate) pid: u32,
    /// Core to which the component is pinned; `null` if it may run on several cores.
    pub(crate) core: Option<usize>,
    /// Share of a core that the stepping thread used in the interval, including spinning; `null` if unknown.
    pub(crate) core_share: Option<f64>,
    /// Share of a core that the component's steps used in the interval, without spinning.
    pub(crate) step_share: f64,
    /// Resident memory of the component's process, bytes; `null` if the process is gone.
    pub(crate) resident_bytes: Option<u64>,
    /// Part of the resident memory in files and shared memory, bytes; `null` if the process is gone.
    pub(crate) shared_bytes: Option<u64>,
    /// Current time of spinning before each release, ns.
    pub(crate) spin_ns: u64,
    /// Stalls of the machine, measured while the component was spinning.
    pub(crate) stalls: Stalls,
    /// Number of restarts of the component.
    pub(crate) restarts: u32,
    /// Measurements over the whole run.
    pub(crate) run: ComponentSpan,
    /// Measurements over the interval.
    pub(crate) interval: ComponentSpan,
}

/// Steps, times and misses of a component in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct ComponentSpan {
    /// Number of steps.
    pub(crate) steps: u64,
    /// Steps per second of the run's clock, from the first to the last step; 0 without steps.
    pub(crate) rate_hz: f64,
    /// Lateness: time from the release or the triggering publication to the start of the step, ns.
    pub(crate) lateness_ns: Percentiles,
    /// Execution time, ns of wall-clock time: from the start to the end of the step.
    pub(crate) execution_ns: Percentiles,
    /// CPU time of each step, without spinning, ns.
    pub(crate) cpu_ns: Percentiles,
    /// Missed steps by cause, and their consequences.
    pub(crate) misses: Misses,
    /// Number of releases by events that were delayed by `min_interval`.
    pub(crate) deferred: u64,
    /// Number of steps that returned an error and were tolerated.
    pub(crate) errors: u64,
    /// Number of samples withheld because they were late, or refused because of their content.
    pub(crate) refused: u64,
    /// Number of heap allocations in steps; `null` if the component's program does not count them.
    pub(crate) allocations: Option<u64>,
    /// Number of heap allocations by documented third-party code in steps; `null` if the component's program
    /// does not count them.
    pub(crate) allocations_apart: Option<u64>,
    /// Number of page faults of the stepping thread.
    pub(crate) page_faults: u64,
}

/// Measurements of one latency budget.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct LatencyTop {
    /// Name of the topic at the head of the chain.
    pub(crate) from: String,
    /// Name of the topic at the end of the chain.
    pub(crate) to: String,
    /// Latency budget, ns.
    pub(crate) max_ns: u64,
    /// Measurements over the whole run.
    pub(crate) run: LatencySpan,
    /// Measurements over the interval.
    pub(crate) interval: LatencySpan,
}

/// Latencies in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct LatencySpan {
    /// Number of measured latencies.
    pub(crate) count: u64,
    /// Number of latencies above the budget.
    pub(crate) missed: u64,
    /// Measured latencies, ns.
    pub(crate) latency_ns: Percentiles,
}

/// Measurements of one edge: a topic and one of its readers.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct EdgeTop {
    /// Name of the topic.
    pub(crate) topic: String,
    /// Name of the component that reads the topic.
    pub(crate) reader: String,
    /// Measurements over the whole run.
    pub(crate) run: EdgeSpan,
    /// Measurements over the interval.
    pub(crate) interval: EdgeSpan,
}

/// Samples read over an edge in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct EdgeSpan {
    /// Number of samples read.
    pub(crate) read: u64,
    /// Ages of samples since their publication, at the start of the step that first read them, ns.
    pub(crate) age_ns: Percentiles,
}

/// Use of one core of the machine, as shares of the interval. The kernel counts in steps of 10 ms.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct CoreTop {
    /// Index of the core.
    pub(crate) core: usize,
    /// Share of the interval spent in programs.
    pub(crate) user: f64,
    /// Share spent in the kernel on behalf of programs.
    pub(crate) system: f64,
    /// Share spent in interrupts.
    pub(crate) interrupts: f64,
    /// Share in which the core was idle.
    pub(crate) idle: f64,
    /// Share stolen by the host of the virtual machine.
    pub(crate) stolen: f64,
    /// Names of the components pinned to the core.
    pub(crate) components: Vec<String>,
}

/// The span of time shown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Span {
    /// The whole run.
    #[default]
    Run,
    /// The last interval.
    Interval,
}

macro_rules! over {
    ($($type:ident => $span:ident),*) => {
        $(impl $type {
            /// Returns the data of this span of time.
            pub(super) fn over(&self, span: Span) -> &$span {
                match span {
                    Span::Run => &self.run,
                    Span::Interval => &self.interval,
                }
            }
        })*
    };
}
over!(ComponentTop => ComponentSpan, LatencyTop => LatencySpan, EdgeTop => EdgeSpan);
