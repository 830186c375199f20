//! The data of `motorium top`: printed by `--json`, shown by its tables.

use motorium::launcher::LoggedEvent;
use motorium::plan::ClockKind;
use motorium::region::{GateReport, Misses, Phase, Stalls};
use motorium::telemetry::Percentiles;
use schemars::JsonSchema;
use serde::Serialize;

/// Version of this format; raised when a field changes its meaning or goes.
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
    /// The clock that drives it.
    pub(crate) clock: ClockKind,
    /// State of the graph.
    pub(crate) state: State,
    /// Time since the start on the run's clock, s; 0 before it.
    pub(crate) elapsed_s: f64,
    /// Length of the interval in wall-clock time, s.
    pub(crate) interval_s: f64,
    /// Each component, in the order of the graph file.
    pub(crate) components: Vec<ComponentTop>,
    /// Each latency budget, in the order of the graph file.
    pub(crate) latencies: Vec<LatencyTop>,
    /// Each topic and each of its readers.
    pub(crate) edges: Vec<EdgeTop>,
    /// Each core of the machine.
    pub(crate) cores: Vec<CoreTop>,
    /// The newest events of the run, at most five, oldest first.
    pub(crate) events: Vec<LoggedEvent>,
}

/// State of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    /// Its components are being configured and connected.
    Starting,
    /// Its components step.
    Running,
    /// Its actuators apply the safe state.
    SafeStop,
    /// The run has been asked to end.
    Stopping,
}

/// One component.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct ComponentTop {
    /// Its name in the graph.
    pub(crate) name: String,
    /// Phase of its life.
    pub(crate) phase: Phase,
    /// `true` for an actuator in its safe state.
    pub(crate) safe: bool,
    /// The account of an actuator's command gate over the whole run; `null` for other components.
    pub(crate) gate: Option<GateReport>,
    /// Its process.
    pub(crate) pid: u32,
    /// The core it is pinned to; `null` if it may run on several.
    pub(crate) core: Option<usize>,
    /// Share of a core that its stepping thread used in the interval, spinning included; `null` if unknown.
    pub(crate) core_share: Option<f64>,
    /// Share of a core that its steps used in the interval, without spinning.
    pub(crate) step_share: f64,
    /// Memory of its process in use, bytes; `null` if the process is gone.
    pub(crate) resident_bytes: Option<u64>,
    /// The part of it in files and shared memory, bytes.
    pub(crate) shared_bytes: Option<u64>,
    /// Current length of spinning before a release, ns.
    pub(crate) spin_ns: u64,
    /// Stalls of the machine seen while it spun.
    pub(crate) stalls: Stalls,
    /// Number of restarts.
    pub(crate) restarts: u32,
    /// Over the whole run.
    pub(crate) run: ComponentSpan,
    /// Over the interval.
    pub(crate) interval: ComponentSpan,
}

/// Steps, times and misses of a component in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct ComponentSpan {
    /// Number of steps.
    pub(crate) steps: u64,
    /// Steps per second of the run's clock, from the first to the last step; 0 without steps.
    pub(crate) rate_hz: f64,
    /// From release (or triggering publication) to the beginning of the step, ns.
    pub(crate) lateness_ns: Percentiles,
    /// From the beginning to the end of the step, in wall-clock time, ns.
    pub(crate) execution_ns: Percentiles,
    /// CPU time of each step, without spinning, ns.
    pub(crate) cpu_ns: Percentiles,
    /// Missed steps by cause, and their consequences.
    pub(crate) misses: Misses,
    /// Releases by events that waited for `min_interval`.
    pub(crate) deferred: u64,
    /// Steps that returned an error and were tolerated.
    pub(crate) errors: u64,
    /// Samples withheld or refused because of their content or their lateness.
    pub(crate) refused: u64,
    /// Heap allocations in steps; `null` if its program does not count them.
    pub(crate) allocations: Option<u64>,
    /// Heap allocations in steps by foreign code named in its docs; `null` likewise.
    pub(crate) allocations_apart: Option<u64>,
    /// Page faults of its stepping thread.
    pub(crate) page_faults: u64,
}

/// One latency budget.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct LatencyTop {
    /// Topic at the head of the chain.
    pub(crate) from: String,
    /// Topic at its end.
    pub(crate) to: String,
    /// The budget, ns.
    pub(crate) max_ns: u64,
    /// Over the whole run.
    pub(crate) run: LatencySpan,
    /// Over the interval.
    pub(crate) interval: LatencySpan,
}

/// Latencies in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct LatencySpan {
    /// Number of measurements.
    pub(crate) count: u64,
    /// Measurements above the budget.
    pub(crate) missed: u64,
    /// Measured, ns.
    pub(crate) latency_ns: Percentiles,
}

/// A topic and one of its readers.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct EdgeTop {
    /// The topic.
    pub(crate) topic: String,
    /// The component that reads it.
    pub(crate) reader: String,
    /// Over the whole run.
    pub(crate) run: EdgeSpan,
    /// Over the interval.
    pub(crate) interval: EdgeSpan,
}

/// Samples read over an edge in a span of time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct EdgeSpan {
    /// Samples read.
    pub(crate) read: u64,
    /// Age of each, since its publication, at the beginning of the step that first read it, ns.
    pub(crate) age_ns: Percentiles,
}

/// Use of a core of the machine in the interval, as shares of it; the kernel counts in steps of 10 ms.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct CoreTop {
    /// Its number.
    pub(crate) core: usize,
    /// Programs.
    pub(crate) user: f64,
    /// The kernel, on behalf of programs.
    pub(crate) system: f64,
    /// Interrupts.
    pub(crate) interrupts: f64,
    /// Nothing.
    pub(crate) idle: f64,
    /// Time stolen by the host of the virtual machine.
    pub(crate) stolen: f64,
    /// Components pinned to it.
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
