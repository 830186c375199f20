//! Components that declare that they cannot keep deadlines.

use super::super::draft::Draft;
use super::super::wiring::Wiring;
use crate::declare::Direction;
use crate::graph::diagnostic::Report;
use crate::graph::values::Schedule;
use crate::nearest::list;

/// Warns about components that cannot keep deadlines, with their reasons and the real-time components that
/// depend on them. A graph accepts this with `schedule = "normal"`.
pub(super) fn warn(drafts: &[Draft<'_, '_>], schedules: &[Schedule], wiring: &Wiring, report: &mut Report) {
    for (component, draft) in drafts.iter().enumerate() {
        let declared = draft.declaration.as_ref().and_then(|declared| declared.not_real_time.as_ref());
        let Some(reason) = declared else { continue };
        let insists = schedules[component] != Schedule::Normal;
        if !insists && draft.table.schedule.is_some() {
            continue;
        }
        let (place, label, advice) = match &draft.table.schedule {
            Some(at) => (&at.span, "requests a real-time class", "leave `schedule` out, or write \"normal\""),
            None => (
                &draft.place,
                "scheduled as `normal`",
                "write `schedule = \"normal\"` if the graph tolerates that",
            ),
        };
        let diagnostic = report
            .warning(format!("component `{}` is not real-time: {reason}", draft.name))
            .label(place, label)
            .advise(advice);
        let behind = dependants(component, drafts.len(), wiring);
        let real_time = behind.into_iter().filter(|other| schedules[*other] != Schedule::Normal);
        let names: Vec<&str> = real_time.map(|other| drafts[other].name).collect();
        if !names.is_empty() {
            diagnostic.note(format!("real-time components that depend on it: {}", list(names)));
        }
    }
}

/// Returns the components that read topics of a component, directly or through others, in file order.
fn dependants(component: usize, count: usize, wiring: &Wiring) -> Vec<usize> {
    let (mut is_found, mut open) = (vec![false; count], vec![component]);
    while let Some(writer) = open.pop() {
        let topics = wiring.of_component(writer, Direction::Output).filter_map(|wire| wire.topic);
        for reader in topics.flat_map(|topic| wiring.of_topic(topic, Direction::Input)) {
            if !is_found[reader.component] {
                is_found[reader.component] = true;
                open.push(reader.component);
            }
        }
    }
    (0..count).filter(|other| is_found[*other] && *other != component).collect()
}
