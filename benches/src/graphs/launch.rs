//! Runs a graph and keeps its histograms.

use std::path::{Path, PathBuf};

use motorium::graph::{self, Machine};
use motorium::launcher::{Event, Exit, Options, Report};
use motorium::plan::Plan;
use motorium::region::Region;
use motorium::run_folder::RunFolder;
use motorium::session;
use motorium::worker::Registry;
use serde::de::DeserializeOwned;

use crate::host::Causes;
use crate::{Distribution, MeasureError};

/// A graph that has run.
#[derive(Debug)]
pub struct Ran {
    /// Report of the run.
    pub report: Report,
    /// Lateness of each component's steps after their releases, ns.
    pub lateness: Vec<Distribution>,
    /// Duration of the steps of each component, ns.
    pub execution: Vec<Distribution>,
    /// Latencies of each latency budget, ns.
    pub latencies: Vec<Distribution>,
}

impl Ran {
    /// Returns the value `what` from the result of a component; `None` if it is missing.
    pub fn result<T: DeserializeOwned>(&self, component: &str, what: &str) -> Option<T> {
        serde_json::from_value(self.report.results.get(component)?.get(what)?.clone()).ok()
    }

    /// Returns the durations of a component's steps, ns.
    ///
    /// # Errors
    /// The component made no step, or its steps allocated heap memory.
    pub fn steps_of(&self, component: &str) -> Result<Distribution, MeasureError> {
        let none = || MeasureError::Ended(format!("`{component}` has made no step"));
        let components = &self.report.components;
        let index = components.iter().position(|found| found.name == component).ok_or_else(none)?;
        if let Some(count) = components[index].allocations.filter(|count| *count > 0) {
            return Err(MeasureError::Allocations { component: component.to_string(), count });
        }
        self.execution.get(index).filter(|steps| steps.count > 0).cloned().ok_or_else(none)
    }

    /// Returns the causes of lateness of all components.
    pub fn causes(&self) -> Causes {
        Causes::from_report(&self.report)
    }

    /// Returns the lowest `SCHED_FIFO` priority among the components; 0 for normal time sharing.
    pub fn fifo(&self) -> u32 {
        self.report.components.iter().map(|component| component.fifo_priority).min().unwrap_or(0)
    }
}

/// Runs the graph file `text` to its end with `program`, which hosts `bench.relay`.
///
/// # Errors
/// The graph cannot run on this machine, did not start, or ended early.
pub fn run(program: &Path, registry: &Registry, name: &str, text: String) -> Result<Ran, MeasureError> {
    run_plan(program, registry, plan(registry, name, text)?)
}

/// Runs the graph file `text` like [`run`], and traces it with `trace_events` events per component.
///
/// # Errors
/// Same as [`run`].
pub fn run_traced(
    program: &Path,
    registry: &Registry,
    name: &str,
    text: String,
    trace_events: usize,
) -> Result<Ran, MeasureError> {
    run_plan(program, registry, Plan { trace_events, ..plan(registry, name, text)? })
}

fn plan(registry: &Registry, name: &str, text: String) -> Result<Plan, MeasureError> {
    let checked = graph::check(Path::new(name), text, &[], registry, &Machine::detect());
    Ok(checked.map_err(|error| MeasureError::Graph(error.render(false)))?.plan)
}

fn run_plan(program: &Path, registry: &Registry, plan: Plan) -> Result<Ran, MeasureError> {
    let options = Options::processes(PathBuf::from(program));
    // Mapped while the run lives: the mapping outlives the name.
    let mut region: Option<Region> = None;
    let mut trouble = None;
    let report = session::run(plan, registry, &options, &mut |event| match event {
        Event::Created { run, .. } => region = RunFolder::find(run).and_then(|folder| folder.region().ok()),
        Event::Failed { component, reason, .. } => trouble = Some(format!("`{component}`: {reason}")),
        _ => {}
    })?;
    if report.exit != Exit::Finished {
        return Err(match (&report.exit, trouble) {
            (Exit::Interrupted, _) => MeasureError::Interrupted,
            (_, Some(trouble)) => MeasureError::Ended(trouble),
            (exit, None) => MeasureError::Ended(format!("{exit:?}")),
        });
    }
    let region = region.ok_or(MeasureError::Ended("its memory could not be read".to_string()))?;
    let blocks = region.components();
    Ok(Ran {
        report,
        lateness: blocks.iter().map(|block| Distribution::from_histogram(&block.lateness)).collect(),
        execution: blocks.iter().map(|block| Distribution::from_histogram(&block.execution)).collect(),
        latencies: region
            .latencies()
            .iter()
            .map(|block| Distribution::from_histogram(&block.latency))
            .collect(),
    })
}
