//! Support of the component tests: a graph in one process, and rejected configurations.

use std::path::Path;

use motorium::component::Component;
use motorium::declare::{ConfigError, RobotReference};
use motorium::launcher::{Options, Report};
use motorium::session;
use motorium::telemetry::CountingAllocator;
use motorium::worker::{Kind, Registry, RobotSource};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// The configuration of a component without settings.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Nothing {}

/// Checks and runs a graph of these kinds; its files are relative to `path`.
pub(crate) fn run(path: &Path, graph: String, kinds: impl IntoIterator<Item = Kind>) -> Report {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds);
    let machine = motorium::graph::Machine::detect();
    let checked = motorium::graph::check(path, graph, &[], &registry, &machine)
        .unwrap_or_else(|error| panic!("{error}"));
    session::run(checked.plan, &registry, &Options::threads(), &mut |_| {}).unwrap()
}

/// Returns the allocations in steps (if they are counted) and failed steps of the component `policy`.
pub(crate) fn faults(report: &Report) -> (Option<u64>, u64) {
    let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
    (policy.allocations, policy.errors + policy.refused)
}

/// Returns the error of a configuration for a robot (if any), with its files relative to `base`.
pub(crate) fn refusal<C: Component>(
    config: serde_json::Value,
    robot: Option<&str>,
    base: &Path,
) -> ConfigError {
    let robot = robot.map(|urdf| RobotReference {
        name: "arm".into(),
        urdf: urdf.into(),
        base: base.into(),
        ..RobotReference::default()
    });
    Kind::of::<C>().declare(config, robot).unwrap_err().error
}
