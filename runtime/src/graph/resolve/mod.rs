//! Resolution of tables to a plan: names, wires and defaults.
//!
//! Each step continues after earlier errors as far as possible, so that one check finds most of them.
//! Consequences of reported errors are not reported.

mod activate;
mod assemble;
mod context;
mod declare;
mod doubts;
mod draft;
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

pub(super) use context::Context;
pub use declare::{DECLARE_BOUND_NS, DeclareTime};

use super::defaults;
use super::diagnostic::Report;
use super::model::GraphTable;
use super::read::good_or;
use crate::plan::Plan;

/// Resolves a graph and measures the time of each declaration. Returns `None` if and only if an error has
/// been reported.
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
