//! Periods of the components in the file, before any component has declared its ports.

use crate::graph::model::ComponentTable;
use crate::graph::read::{At, good};
use crate::graph::values::TopicName;

/// Returns the period of each component, ns: from its rate or its minimum interval between events, or from
/// the component at the head of its trigger chain. `None` if the file has an error, which is reported when
/// the times are resolved.
pub(super) fn component_periods(components: &[(String, At<ComponentTable<'_>>)]) -> Vec<Option<u64>> {
    let tables: Vec<Option<&ComponentTable<'_>>> = components.iter().map(|(_, at)| at.get()).collect();
    (0..tables.len()).map(|component| of_component(component, &tables)).collect()
}

fn of_component(component: usize, tables: &[Option<&ComponentTable<'_>>]) -> Option<u64> {
    let mut current = tables[component]?;
    // a chain is at most as long as the number of components, unless it is a loop
    for _ in 0..tables.len() {
        if let Some(rate) = good(&current.rate) {
            return Some(rate.period_ns);
        }
        if let Some(events) = good(&current.activate) {
            return good(&events.min_interval).map(|interval| interval.ns);
        }
        let TopicName(trigger) = good(&current.trigger)?;
        current = tables.iter().flatten().find(|table| publishes(table, trigger))?;
    }
    None
}

fn publishes(table: &ComponentTable<'_>, topic: &str) -> bool {
    let wires = good(&table.publish).map(|wires| wires.0.as_slice()).unwrap_or_default();
    wires.iter().any(|(_, at)| at.get().is_some_and(|TopicName(name)| name == topic))
}
