//! The safety settings and the restart policies.

mod actuators;
mod bounds;
mod emergency;

pub(super) use actuators::resolve as of_actuators;
pub(super) use emergency::emergency_stop;

use super::draft::Draft;
use super::timing::Timing;
use super::wiring::Wiring;
use crate::declare::Direction;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::{At, good, good_or};
use crate::plan::{Activation, GateRules, SafetyPlan};
use crate::state::{JointCommand, StateBuffer as _};
use crate::units::TimeSpan;

/// Maximum time allowed for stopping a component.
const LONGEST_STOP: TimeSpan = TimeSpan { ns: 60_000_000_000 };

/// Resolves the `[safety]` table and checks it, the restart policies and the duration.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    causes: &[Option<usize>],
    report: &mut Report,
) -> SafetyPlan {
    let table = good(&graph.safety);
    let stale_after =
        table.map_or(defaults::STALE_AFTER, |table| good_or(&table.stale_after, defaults::STALE_AFTER));
    let at = table.and_then(|table| table.stale_after.as_ref());
    bounds::not_zero("stale_after", at, "every command would be stale immediately", report);
    if let Some(at) = graph.duration.as_ref().filter(|at| at.get() == Some(&TimeSpan { ns: 0 })) {
        report
            .error("`duration` is zero")
            .label(&at.span, "the run would end immediately")
            .advise("leave `duration` out to run until stopped");
    }
    for draft in drafts {
        let at = draft.table.stop_within.as_ref();
        bounds::not_zero("stop_within", at, "the component would be killed before it could stop", report);
        if let Some(at) = at.filter(|at| at.get().is_some_and(|time| time.ns > LONGEST_STOP.ns)) {
            report
                .error(format!("`stop_within` of component `{}` is longer than {LONGEST_STOP}", draft.name))
                .label(&at.span, "the end of a run could last this long")
                .advise("let the component write long output while it runs, not in `stop`");
        }
    }
    for restart in drafts.iter().filter_map(|draft| good(&draft.table.restart)) {
        bounds::not_zero("window", restart.window.as_ref(), "no restart would be counted", report);
        bounds::not_zero("within", restart.within.as_ref(), "no restart would be quick enough", report);
        if let Some(at) = restart.at_most.as_ref().filter(|at| at.get() == Some(&0)) {
            report
                .error("`at_most` is 0")
                .label(&at.span, "no restart is allowed")
                .advise("to disable restarts, write `when = \"never\"`");
        }
    }
    stale_commands(stale_after, at, drafts, wiring, timing, report);
    no_actuator(graph, drafts, report);
    let chains_ns = chains_ns(drafts, wiring, timing, causes);
    let settle = table.map_or(defaults::SETTLE, |table| good_or(&table.settle, defaults::SETTLE));
    let source = table.and_then(|table| good(&table.source_stale_after)).map(|span| span.ns);
    if let Some(table) = table {
        bounds::check(table, stale_after, chains_ns, report);
    }
    let max_age = emergency::max_age(table, drafts, wiring, timing, report);
    SafetyPlan {
        stale_after_ns: stale_after.ns,
        source_stale_after_ns: source.unwrap_or(stale_after.ns.saturating_add(2 * chains_ns)),
        gate: GateRules {
            safe_state: table
                .map_or(defaults::SAFE_STATE, |table| good_or(&table.safe_state, defaults::SAFE_STATE)),
            limits: table.map_or(defaults::LIMITS, |table| good_or(&table.limits, defaults::LIMITS)),
            resume: table.map_or(defaults::RESUME, |table| good_or(&table.resume, defaults::RESUME)),
        },
        settle_ns: settle.ns,
        emergency_stop_max_age_ns: max_age.ns,
        stop_together: table.is_some_and(|table| good_or(&table.stop_together, false)),
    }
}

/// Returns the longest sum of the periods of the components on the path from a measurement to an actuator's
/// command, ns.
fn chains_ns(drafts: &[Draft<'_, '_>], wiring: &Wiring, timing: &Timing, causes: &[Option<usize>]) -> u64 {
    let mut longest = 0;
    for (component, draft) in drafts.iter().enumerate() {
        if !draft.is_actuator() {
            continue;
        }
        for (index, port) in draft.ports(Direction::Input).enumerate() {
            if port.layout.type_name != JointCommand::NAME {
                continue;
            }
            let mut sum_ns: u64 = 0;
            let mut input = Some((component, index));
            // A chain of causes has no loop, unless one was reported; the count bounds it.
            for _ in 0..drafts.len() {
                let writer = input
                    .and_then(|(component, index)| wiring.of_port(component, Direction::Input, index))
                    .and_then(|wire| wiring.writer(wire.topic?));
                let Some(writer) = writer.map(|wire| wire.component) else { break };
                let is_head = timing.activation[writer].as_ref().is_some_and(Activation::is_head);
                sum_ns += timing.period_ns(writer).filter(|_| is_head).unwrap_or(0);
                input = causes.get(writer).copied().flatten().map(|cause| (writer, cause));
            }
            longest = longest.max(sum_ns);
        }
    }
    longest
}

/// Warns about commands that become stale before the next one arrives, which would put the robot into its
/// safe state half of the time.
fn stale_commands(
    stale_after: TimeSpan,
    at: Option<&At<TimeSpan>>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    report: &mut Report,
) {
    for (component, draft) in drafts.iter().enumerate() {
        if !draft.is_actuator() || actuators::stale_after(draft).is_some() {
            continue;
        }
        let Some((span, writer, period_ns)) = actuators::slowest_source(component, drafts, wiring, timing)
        else {
            continue;
        };
        if stale_after.ns >= period_ns || stale_after.ns == 0 {
            continue;
        }
        let period = TimeSpan { ns: period_ns };
        let name = drafts[writer].name;
        let diagnostic = report
            .warning(format!(
                "commands become stale before the next command arrives: `{name}` writes a command every {period}"
            ))
            .advise(format!("set `stale_after` in `[safety]` to more than {period}, or run `{name}` faster"));
        match at {
            Some(at) => {
                diagnostic
                    .label(&at.span, format!("shorter than {period}"))
                    .and(&span, format!("`{}` applies its commands", draft.name));
            }
            None => {
                diagnostic.label(&span, format!("`stale_after` defaults to {stale_after}"));
            }
        }
    }
}

/// Warns about a `[safety]` table in a graph without actuators.
fn no_actuator(graph: &GraphTable<'_>, drafts: &[Draft<'_, '_>], report: &mut Report) {
    let Some(safety) = &graph.safety else { return };
    let known = drafts.iter().all(|draft| draft.declaration.is_some());
    let actuators = drafts.iter().filter_map(|draft| draft.declaration.as_ref()).any(|d| d.actuator);
    if known && !actuators && !drafts.is_empty() {
        report
            .warning("no component of this graph applies commands to a robot")
            .label(&safety.key, "this table has no effect")
            .advise("leave `[safety]` out, or add the component that moves the robot");
    }
}
