//! The emergency-stop topic of `[safety]`: the inputs of actuators, and the age of its values.

use crate::declare::{Direction, PortDeclaration, TopicPattern};
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::{GraphTable, SafetyTable};
use crate::graph::read::{good, good_or};
use crate::graph::resolve::draft::Draft;
use crate::graph::resolve::timing::Timing;
use crate::graph::resolve::wiring::Wiring;
use crate::plan::EMERGENCY_STOP_PORT;
use crate::state::{EmergencyStop, StateBuffer as _};
use crate::units::TimeSpan;

/// Longest accepted `emergency_stop_max_age`.
const LONGEST: TimeSpan = TimeSpan { ns: 10_000_000_000 };

/// Adds the emergency-stop topic as an input of each actuator, read by its gate.
pub(in crate::graph::resolve) fn emergency_stop(graph: &GraphTable<'_>, drafts: &mut [Draft<'_, '_>]) {
    if good(&graph.safety).and_then(|table| good(&table.emergency_stop)).is_none() {
        return;
    }
    for declaration in drafts.iter_mut().filter_map(|draft| draft.declaration.as_mut()) {
        if declaration.actuator && declaration.ports.iter().all(|port| port.name != EMERGENCY_STOP_PORT) {
            declaration.ports.push(PortDeclaration {
                name: EMERGENCY_STOP_PORT.to_string(),
                direction: Direction::Input,
                pattern: TopicPattern::State,
                layout: EmergencyStop::layout(),
                required: false,
                doc: "emergency stop of `[safety]`".to_string(),
            });
        }
    }
}

/// Returns the maximum age of the newest value on the topic; 0 for a graph without an emergency stop.
///
/// Rejects an age that a working publisher exceeds, which would stop the robot between two values.
pub(super) fn max_age(
    table: Option<&SafetyTable>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    report: &mut Report,
) -> TimeSpan {
    let default = defaults::EMERGENCY_STOP_MAX_AGE;
    let Some(table) = table else { return TimeSpan { ns: 0 } };
    let at = table.emergency_stop_max_age.as_ref();
    super::bounds::not_zero("emergency_stop_max_age", at, "the robot could never move", report);
    let Some(topic) = &table.emergency_stop else {
        if let Some(at) = at {
            report
                .warning("`emergency_stop_max_age` has no effect without `emergency_stop`")
                .label(&at.span, "no topic is watched")
                .advise("name the topic of the emergency stop, or leave this key out");
        }
        return TimeSpan { ns: 0 };
    };
    let max_age = good_or(&table.emergency_stop_max_age, default);
    if let Some(at) = at.filter(|_| max_age > LONGEST) {
        report
            .error(format!(
                "`emergency_stop_max_age` is {max_age}: a dead button would go unnoticed for this time"
            ))
            .label(&at.span, format!("expected at most {LONGEST}"))
            .advise("let the publisher repeat its value several times per second");
    }
    if good(&table.emergency_stop).is_none() {
        return max_age;
    }
    let writer = drafts.iter().enumerate().find_map(|(component, draft)| {
        let mut ports = draft.ports(Direction::Input).enumerate();
        let (index, _) = ports.find(|(_, port)| port.name == EMERGENCY_STOP_PORT)?;
        let wire = wiring.of_port(component, Direction::Input, index)?;
        wiring.writer(wire.topic?)
    });
    let Some(writer) = writer.map(|wire| wire.component) else { return max_age };
    if let Some(period_ns) =
        timing.period_ns(writer).filter(|period_ns| *period_ns > max_age.ns && max_age.ns > 0)
    {
        let (name, period) = (drafts[writer].name, TimeSpan { ns: period_ns });
        report
            .warning(format!(
                "the emergency stop counts as pressed between two values: `{name}` writes a value every {period}"
            ))
            .label(at.map_or(&topic.span, |at| &at.span), format!("`emergency_stop_max_age` is {max_age}"))
            .advise(format!("run `{name}` faster, or allow more than {period}"));
    }
    max_age
}
