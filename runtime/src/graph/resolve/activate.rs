//! Activation of a component by events from outside the graph.

use super::draft::Draft;
use crate::graph::diagnostic::Report;
use crate::graph::model::ActivateTable;
use crate::graph::read::{At, good};
use crate::graph::source::Span;
use crate::plan::ClockKind;
use crate::units::TimeSpan;

/// Smallest `min_interval`, the same as for rates: 100 kHz.
const SHORTEST: TimeSpan = TimeSpan { ns: 10_000 };

/// Checks the activation of a component by events. Returns its `min_interval`, ns.
pub(super) fn resolve(
    draft: &Draft<'_, '_>,
    at: &At<ActivateTable>,
    clock: ClockKind,
    report: &mut Report,
) -> Option<u64> {
    let table = draft.table;
    let name = draft.name;
    let other = [
        (table.rate.as_ref().map(|rate| &rate.key), "rate"),
        (table.trigger.as_ref().map(|trigger| &trigger.key), "trigger"),
    ];
    if let [(Some(place), key), ..] | [_, (Some(place), key)] = other {
        report
            .error(format!("component `{name}` has both `{key}` and `activate`"))
            .label(&at.key, "expected either `activate`, `rate` or `trigger`")
            .and(place, "the component is already released by this")
            .advise("leave one of them out");
        return None;
    }
    if let Some(phase) = &table.phase {
        report
            .error(format!("component `{name}` has a phase but no rate"))
            .label(&phase.key, "does not apply to a component released by events")
            .and(&at.key, "the component steps when an event arrives")
            .advise("leave `phase` out");
    }
    can_wait(draft, at, report);
    if clock == ClockKind::Lockstep {
        report
            .error(format!("component `{name}` is released by events, which do not occur in lockstep"))
            .label(&at.key, "events arrive in real time, from outside the graph")
            .advise(
                "in lockstep give it a `rate` instead of `activate`: it then polls for events at each step, and runs are not \
                 reproducible; or replace it by a component that simulates the source",
            );
    }
    let values = at.get()?;
    let missing = [("on", values.on.is_none()), ("min_interval", values.min_interval.is_none())];
    for (key, _) in missing.iter().filter(|(key, missing)| *missing && !values.meant.contains(key)) {
        report
            .error(format!("the `activate` of component `{name}` has no `{key}`"))
            .label(&at.span, format!("`{key}` is missing"))
            .advise("write `activate = { on = \"fd\", min_interval = \"1 ms\" }`");
    }
    let interval = values.min_interval.as_ref()?;
    let time = *interval.get()?;
    if time < SHORTEST {
        report
            .error(format!("the `min_interval` of component `{name}` is {time}"))
            .label(&interval.span, format!("expected {SHORTEST} or more"))
            .advise("leave enough time between two steps, such as \"1 ms\"");
        return None;
    }
    values.on.as_ref()?.get()?;
    Some(time.ns)
}

/// Checks that the kind has a descriptor to wait for.
fn can_wait(draft: &Draft<'_, '_>, at: &At<ActivateTable>, report: &mut Report) {
    if draft.declaration.as_ref().is_none_or(|declaration| declaration.wakes_on_descriptor) {
        return;
    }
    let kind = draft.table.kind.as_ref().or(draft.table.exec.as_ref());
    let diagnostic = report
        .error(format!("component `{}` has no file descriptor that could release its steps", draft.name))
        .label(
            &at.span,
            "only kinds that wait for devices or programs outside the graph have a file descriptor",
        )
        .advise("give it a `rate`, or a `trigger`");
    if let Some(kind) = kind.filter(|kind| kind.get().is_some()) {
        diagnostic.and(&kind.span, "this kind reads and writes topics only");
    }
}

/// Returns the key that replaces a rate, the reason why a grid of releases is meaningless, and the time at
/// which the component steps instead; `None` for a clock-released component.
pub(super) fn not_by_the_clock<'d>(
    draft: &'d Draft<'_, '_>,
) -> Option<(&'d Span, &'static str, &'static str)> {
    if let Some(trigger) = &draft.table.trigger {
        let why = "does not apply to a triggered component";
        return Some((&trigger.key, why, "the component steps when this topic is published"));
    }
    let activate = draft.table.activate.as_ref()?;
    let why = "does not apply to a component released by events";
    Some((&activate.key, why, "the component steps when an event arrives"))
}

/// Returns advice for a component without an activation whose kind has a descriptor.
pub(super) fn advice(draft: &Draft<'_, '_>) -> Option<String> {
    let waits = draft.declaration.as_ref().is_some_and(|declaration| declaration.wakes_on_descriptor);
    let advice = "add `activate = { on = \"fd\", min_interval = \"1 ms\" }`, or a `rate`";
    (waits && good(&draft.table.rate).is_none()).then(|| advice.to_string())
}
