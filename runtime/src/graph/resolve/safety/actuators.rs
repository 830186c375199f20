//! The table `[component.X.safety]` with the safety settings of one actuator.

use super::super::draft::Draft;
use super::super::timing::Timing;
use super::super::wiring::Wiring;
use super::bounds;
use crate::declare::Direction;
use crate::graph::diagnostic::Report;
use crate::graph::read::{At, good, good_or};
use crate::graph::source::Span;
use crate::plan::{ActuatorSafety, GateRules, SafetyPlan};
use crate::state::{JointCommand, StateBuffer as _};
use crate::units::TimeSpan;

/// Returns the `stale_after` of a component if it overrides the graph's.
pub(super) fn stale_after<'d>(draft: &'d Draft<'_, '_>) -> Option<&'d At<TimeSpan>> {
    good(&draft.table.safety).and_then(|table| table.stale_after.as_ref())
}

/// Returns the slowest source of an actuator's commands: the position of its wire, its index and its period,
/// ns.
pub(super) fn slowest_source(
    component: usize,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
) -> Option<(Span, usize, u64)> {
    let commands = drafts[component].ports(Direction::Input).enumerate();
    let commands = commands.filter(|(_, port)| port.layout.type_name == JointCommand::NAME);
    let sources = commands.filter_map(|(index, _)| {
        let wire = wiring.of_port(component, Direction::Input, index)?;
        let writer = wiring.writer(wire.topic?)?.component;
        Some((wire.span.clone(), writer, timing.period_ns(writer)?))
    });
    sources.max_by_key(|(.., period_ns)| *period_ns)
}

/// Resolves and checks the safety settings of each component; `None` if the graph's apply.
pub(in super::super) fn resolve(
    graph: &SafetyPlan,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    report: &mut Report,
) -> Vec<Option<ActuatorSafety>> {
    let each = drafts.iter().enumerate().map(|(index, draft)| {
        let at = draft.table.safety.as_ref()?;
        let table = at.get()?;
        if draft.declaration.is_some() && !draft.is_actuator() {
            report
                .error(format!("component `{}` is not an actuator", draft.name))
                .label(&at.span, format!("{} applies no commands to a robot", draft.what()))
                .advise("move the table to the component that moves the robot, or remove it");
            return None;
        }
        bounds::not_zero(
            "stale_after",
            table.stale_after.as_ref(),
            "every command would be stale immediately",
            report,
        );
        bounds::check_age("stale_after", table.stale_after.as_ref(), 0, report);
        bounds::check_settle(table.settle.as_ref(), report);
        if let Some(at) = &table.stale_after
            && let Some(age) = at.get()
            && let Some((span, writer, period_ns)) = slowest_source(index, drafts, wiring, timing)
            && age.ns < period_ns
        {
            let (period, name) = (TimeSpan { ns: period_ns }, drafts[writer].name);
            report
                .error(format!("commands of `{}` become stale before the next command arrives", draft.name))
                .label(&at.span, format!("{age}, shorter than {period}"))
                .and(&span, format!("`{name}` writes a command every {period}"))
                .advise(format!("set `stale_after` to more than {period}, or run `{name}` faster"));
        }
        let stale_after_ns = good_or(&table.stale_after, TimeSpan { ns: graph.stale_after_ns }).ns;
        let longer_ns = stale_after_ns.saturating_sub(graph.stale_after_ns);
        let shorter_ns = graph.stale_after_ns.saturating_sub(stale_after_ns);
        Some(ActuatorSafety {
            stale_after_ns,
            source_stale_after_ns: (graph.source_stale_after_ns.saturating_add(longer_ns))
                .saturating_sub(shorter_ns)
                .max(stale_after_ns),
            gate: GateRules {
                safe_state: good_or(&table.safe_state, graph.gate.safe_state),
                limits: graph.gate.limits,
                resume: good_or(&table.resume, graph.gate.resume),
            },
            settle_ns: good_or(&table.settle, TimeSpan { ns: graph.settle_ns }).ns,
        })
    });
    each.collect()
}
