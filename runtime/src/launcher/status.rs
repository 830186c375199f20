//! The status of a running graph, read from its control block without touching any component.

use std::sync::atomic::Ordering::Relaxed;

use serde::Serialize;

use super::{EdgeReport, LatencyReport, Launch, report};
use crate::os::monotonic_ns;
use crate::plan::Plan;
use crate::region::{Misses, Phase, Region, Stalls};
use crate::telemetry::Percentiles;

/// The status of a running graph.
#[derive(Debug, Clone, Serialize)]
pub struct Status {
    /// Time since the start, ns.
    pub elapsed_ns: u64,
    /// Each component, in the order of the graph file.
    pub components: Vec<ComponentStatus>,
    /// Each latency budget, in the order of the graph file.
    pub latencies: Vec<LatencyReport>,
    /// Each topic and each of its readers.
    pub edges: Vec<EdgeReport>,
}

/// The status of a component.
#[derive(Debug, Clone, Serialize)]
pub struct ComponentStatus {
    /// Its name.
    pub name: String,
    /// Phase of its life.
    pub phase: Phase,
    /// Its process.
    pub pid: u32,
    /// Steps done.
    pub steps: u64,
    /// Steps per second so far.
    pub rate_hz: f64,
    /// Release lateness, ns.
    pub lateness_ns: Percentiles,
    /// Execution time, wall-clock ns.
    pub execution_ns: Percentiles,
    /// CPU time of each step, ns.
    pub cpu_ns: Percentiles,
    /// Current spin time before a release, ns.
    pub spin_ns: u64,
    /// Stalls of the machine while it spun.
    pub stalls: Stalls,
    /// Missed steps by cause.
    pub misses: Misses,
    /// Restarts.
    pub restarts: u32,
    /// True if it is an actuator in its safe state.
    pub safe: bool,
}

impl Status {
    /// Reads the status of a run.
    pub fn read(plan: &Plan, region: &Region) -> Self {
        let start = region.header().start_ns.load(Relaxed);
        let components = plan
            .components
            .iter()
            .zip(region.components())
            .map(|(component, block)| ComponentStatus {
                name: component.name.clone(),
                phase: block.phase(),
                pid: block.pid.load(Relaxed),
                steps: block.steps.load(Relaxed),
                rate_hz: report::rate_hz(block),
                lateness_ns: block.lateness.percentiles(),
                execution_ns: block.execution.percentiles(),
                cpu_ns: block.cpu.percentiles(),
                spin_ns: block.spin_ns.load(Relaxed),
                stalls: block.stalls(),
                misses: block.misses(),
                restarts: block.restarts.load(Relaxed),
                safe: block.safe.load(Relaxed) != 0,
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

impl Launch<'_> {
    pub(super) fn status(&self) -> Status {
        Status::read(&self.plan, &self.region)
    }
}
