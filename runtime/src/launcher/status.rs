//! The status of a running graph, read from its control block without disturbing components.

use std::sync::atomic::Ordering::Relaxed;

use serde::Serialize;

use super::{ComponentReport, EdgeReport, LatencyReport, report};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, Plan};
use crate::region::{Phase, Region};

/// The status of a running graph.
#[derive(Debug, Clone, Serialize)]
pub struct Status {
    /// Time since the start of the run, ns.
    pub elapsed_ns: u64,
    /// Status of each component, in the order of the graph file.
    pub components: Vec<ComponentStatus>,
    /// Report of each latency budget so far, in the order of the graph file.
    pub latencies: Vec<LatencyReport>,
    /// Report of each edge so far: a topic and one of its readers.
    pub edges: Vec<EdgeReport>,
}

/// Status of a component: its phase, and its measurements so far.
#[derive(Debug, Clone, Serialize)]
pub struct ComponentStatus {
    /// Phase of the component's life.
    pub phase: Phase,
    /// True if the component is an actuator in its safe state.
    pub safe: bool,
    /// Measurements of the component so far.
    #[serde(flatten)]
    pub report: ComponentReport,
}

impl Status {
    /// Reads the status of a run from its control block.
    pub fn read(plan: &Plan, region: &Region) -> Self {
        let start = region.header().start_ns.load(Relaxed);
        let now = match plan.clock {
            ClockKind::Realtime => monotonic_ns(),
            ClockKind::Lockstep => {
                let ticks = region.components().iter().map(|block| block.tick_time_ns.load(Relaxed));
                ticks.max().unwrap_or(0)
            }
        };
        let components = plan
            .components
            .iter()
            .zip(region.components())
            .map(|(component, block)| ComponentStatus {
                phase: block.phase(),
                safe: block.safe.load(Relaxed) != 0,
                report: report::component(component, block, now),
            })
            .collect();
        Self {
            elapsed_ns: monotonic_ns().saturating_sub(start),
            components,
            latencies: report::latencies(plan, region),
            edges: report::edges(plan, region),
        }
    }
}
