//! Resolution of tables to a plan: names, wires and defaults.
//!
//! Each step continues despite earlier mistakes as far as possible, so that one check finds most of them.
//! Consequences of reported mistakes are not reported again.

mod activate;
mod assemble;
mod declare;
mod doubts;
mod episodes;
pub(super) mod exec;
mod expectations;
mod history;
mod latency;
mod liveness;
mod order;
mod parameters;
mod paths;
mod periods;
mod robots;
mod safety;
mod scheduling;
pub(super) mod siblings;
mod timing;
mod topics;
mod wiring;
mod wording;
mod world;

use std::cell::OnceCell;
use std::path::Path;

use super::DeclareTime;
use super::defaults;
use super::diagnostic::Report;
use super::machine::Machine;
use super::model::{ComponentTable, GraphTable};
use super::read::good_or;
use super::source::{Sources, Span};
use super::values::Schedule;
use crate::declare::{Declaration, Direction, Placement, PortDeclaration, RobotReference};
use crate::plan::{Plan, Program};
use crate::worker::Registry;
use siblings::Siblings;

/// The file, the registry and the machine for which a graph is resolved.
pub(super) struct Context<'c> {
    /// The graph file.
    pub file: &'c Path,
    /// All texts; relative paths start in the folder of their file.
    pub sources: &'c Sources,
    /// Kinds of components, and robots.
    pub registry: &'c Registry,
    /// The machine it will run on.
    pub machine: &'c Machine,
    /// Other programs that host kinds, as far as they have been queried.
    siblings: Siblings,
    /// Gravity of the world file, in TOML notation, once read; `None` if unavailable.
    gravity: OnceCell<Option<[String; 3]>>,
}

impl<'c> Context<'c> {
    pub(super) fn new(
        file: &'c Path,
        sources: &'c Sources,
        registry: &'c Registry,
        machine: &'c Machine,
    ) -> Self {
        Self { file, sources, registry, machine, siblings: Siblings::default(), gravity: OnceCell::new() }
    }
}

/// A partially resolved component.
struct Draft<'g, 'i> {
    /// Its name.
    name: &'g str,
    /// Place of its name.
    place: Span,
    /// Its table in the file.
    table: &'g ComponentTable<'i>,
    /// The robot it works on.
    robot: Option<RobotReference>,
    /// The robots it works on by `robots`.
    robots: Vec<RobotReference>,
    /// Its period, clock and folder.
    placement: Placement,
    /// Its program.
    program: Option<Program>,
    /// Its `config` table.
    config: serde_json::Value,
    /// Its declaration; `None` if the query failed, which has been reported.
    declaration: Option<Declaration>,
    /// Wall time of its declaration, ns.
    declare_ns: u64,
}

impl Draft<'_, '_> {
    /// Returns its kind or its program, for messages.
    fn what(&self) -> String {
        match &self.program {
            Some(Program::Builtin { kind } | Program::Sibling { kind, .. }) => format!("`{kind}`"),
            Some(Program::Exec { path }) => format!("`{}`", path.display()),
            None => format!("component `{}`", self.name),
        }
    }

    /// Its scheduling class: of the file, else as it declares.
    fn schedule(&self) -> Schedule {
        let declared = self.declaration.as_ref().is_some_and(|declared| declared.not_real_time.is_some());
        let default = if declared { Schedule::Normal } else { defaults::SCHEDULE };
        good_or(&self.table.schedule, default)
    }

    /// Returns its declared ports of one direction, in order of declaration.
    fn ports(&self, direction: Direction) -> impl Iterator<Item = &PortDeclaration> {
        self.declaration.iter().flat_map(|d| &d.ports).filter(move |port| port.direction == direction)
    }
}

/// Resolves a graph, with the time of each declaration. Returns `None` if and only if an error has been
/// reported.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    context: &Context<'_>,
    report: &mut Report,
) -> Option<(Plan, Vec<DeclareTime>)> {
    if graph.name.is_none() && !graph.meant.contains(&"name") {
        report
            .error("the graph has no name")
            .label(&context.sources.top(), "`name` is missing")
            .advise("begin the file with a line such as `name = \"panda-reach\"`");
    }
    let robots = robots::resolve(graph, context, report);
    let mut drafts = declare::resolve(graph, &robots, context, report);
    safety::emergency_stop(graph, &mut drafts);
    let wiring = wiring::resolve(graph, &drafts, report);
    topics::check(&drafts, &wiring, report);
    let clock = good_or(&graph.clock, defaults::CLOCK);
    let timing = timing::resolve(&drafts, &wiring, clock, report);
    let scheduling = scheduling::resolve(graph, &drafts, (&wiring, &timing), context.machine, report);
    let liveness = liveness::resolve(graph, &drafts, &timing, report);
    let parameters = parameters::resolve(&drafts, report);
    let latencies = latency::resolve(graph, &drafts, &wiring, &timing, report);
    let histories = history::resolve(graph, &drafts, &wiring, report);
    let safety = safety::resolve(graph, &drafts, &wiring, &timing, &latencies.causes, report);
    let actuators = safety::of_actuators(&safety, &drafts, &wiring, &timing, report);
    episodes::check(graph, &drafts, report);
    let expectations = expectations::resolve(graph, &drafts, report);
    if report.has_errors() {
        return None;
    }
    let order = order::execution_order(&timing);
    let times = drafts
        .iter()
        .map(|draft| DeclareTime { component: draft.name.to_string(), wall_ns: draft.declare_ns })
        .collect();
    let parts = assemble::Parts {
        drafts,
        wiring,
        timing,
        scheduling,
        liveness,
        parameters,
        latencies,
        histories,
        safety,
        actuators,
        expectations,
        order,
    };
    let plan = parts.assemble(graph, context);
    Some((plan.expect("every part of a graph without errors is resolved"), times))
}
