//! The table `activate` of a component.

use schemars::JsonSchema;

use crate::graph::diagnostic::Report;
use crate::graph::read::{At, Keys, Read, Value};
use crate::graph::values::EventSource;
use crate::units::TimeSpan;

/// Activation of a component by events from outside the graph.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Activate")]
pub(in crate::graph) struct ActivateTable {
    /// Source of the events.
    #[schemars(required)]
    pub on: Option<At<EventSource>>,
    /// Minimum time between two steps; faster events are delayed and combined into one step.
    #[schemars(required)]
    pub min_interval: Option<At<TimeSpan>>,
    /// Known keys that are probably misspelt in the file.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for ActivateTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let mut table = take_fields!(keys, on, min_interval; meant: Vec::new());
        table.meant = keys.finish("`activate`");
        Some(table)
    }
}
