//! Measured values of a current or past run, added to the picture of its graph.

use std::path::Path;

use anyhow::Context as _;
use motorium::launcher::{EdgeReport, LatencyReport, Report, Status};
use motorium::plan::Plan;
use motorium_pictures::graph::Measured;

use crate::report::microseconds;
use crate::runs::RunArg;

/// Measured values, and the plan of the run if it is still running.
pub(super) struct Source {
    pub(super) plan: Option<Plan>,
    measured: Table,
}

/// Measured rates by component, ages and latencies.
struct Table {
    rates: Vec<(String, f64)>,
    edges: Vec<EdgeReport>,
    latencies: Vec<LatencyReport>,
}

/// Finds the source: a file with the report of a run, or a run by its id or its graph's name. Without an
/// argument, it is the newest run.
pub(super) fn find(what: Option<&str>) -> anyhow::Result<Source> {
    if let Some(path) = what.map(Path::new).filter(|path| path.is_file()) {
        let text = crate::input::text(path)?;
        let report: Report = serde_json::from_str(&text).with_context(|| {
            format!(
                "{} is not a report of a run; `motorium run GRAPH.toml --json > report.json` creates one (a graph file goes \
                 before the options)",
                path.display()
            )
        })?;
        return Ok(Source { plan: None, measured: Table::of_report(report) });
    }
    let run = RunArg::named(what).look()?;
    run.stand_aside();
    let status = Status::read(&run.plan, &run.region);
    Ok(Source { plan: Some(run.plan), measured: Table::of_status(status) })
}

impl Table {
    fn of_report(report: Report) -> Self {
        let rates = report.components.into_iter().map(|component| (component.name, component.rate_hz));
        Self { rates: rates.collect(), edges: report.edges, latencies: report.latencies }
    }

    fn of_status(status: Status) -> Self {
        let rates =
            status.components.into_iter().map(|component| (component.report.name, component.report.rate_hz));
        Self { rates: rates.collect(), edges: status.edges, latencies: status.latencies }
    }
}

impl Source {
    /// Measurements as text for the picture of this plan; blank if missing.
    pub(super) fn describe(&self, plan: &Plan) -> Measured {
        let measured = &self.measured;
        let rate = |name: &str| {
            let (_, hz) = measured.rates.iter().find(|(component, hz)| component == name && *hz > 0.0)?;
            Some(format!("{hz:.1} Hz"))
        };
        // of several readers, the one with the oldest values, ignoring readers that only poll occasionally
        let age = |topic: &str| {
            let edges = || measured.edges.iter().filter(move |edge| edge.topic == topic && edge.read > 0);
            let most = edges().map(|edge| edge.read).max()?;
            let edges = edges().filter(|edge| edge.read * 10 >= most);
            let oldest = edges.max_by_key(|edge| edge.age_ns.p99)?.age_ns;
            Some(format!("read after p50 {} / p99 {} us", microseconds(oldest.p50), microseconds(oldest.p99)))
        };
        let latency = |from: &str, to: &str| {
            let is_it = |seen: &&LatencyReport| seen.from == from && seen.to == to && seen.count > 0;
            let seen = measured.latencies.iter().find(is_it)?;
            Some(format!("p99 {} us, {} missed", microseconds(seen.latency_ns.p99), seen.missed))
        };
        Measured {
            rates: plan.components.iter().map(|component| rate(&component.name)).collect(),
            topics: plan.topics.iter().map(|topic| age(&topic.name)).collect(),
            latencies: plan
                .latencies
                .iter()
                .map(|budget| latency(&plan.topics[budget.from].name, &plan.topics[budget.to].name))
                .collect(),
        }
    }

    /// Returns `true` if any of the values belongs to this plan.
    pub(super) fn fits(&self, plan: &Plan) -> bool {
        plan.components
            .iter()
            .any(|component| self.measured.rates.iter().any(|(name, _)| *name == component.name))
    }
}
