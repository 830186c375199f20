//! The log of events of a run as a topic: `motorium/events`, of the type `motorium.Event`.

use motorium::os::monotonic_ns;
use motorium::plan::ClockKind;
use motorium::region::EventRecord;
use motorium::state::{Decoded, Event, FieldValue, Number, StateBuffer as _};

use super::content::Content;
use super::json::{Line, Row};
use crate::runs::LivingRun;

/// Name of the topic. A graph topic with this name takes precedence.
pub(super) const TOPIC: &str = "motorium/events";

/// Converts an event to a message.
pub(super) fn message(record: &EventRecord) -> Event {
    let mut message = Event::truncated(&record.text);
    message.code = record.kind as u32;
    message.severity = record.severity as u32;
    message.value = record.value;
    message
}

/// Returns the fields of a message.
pub(super) fn decoded(message: &Event) -> Decoded<'static> {
    Decoded(vec![
        ("code", FieldValue::One(Number::from(u64::from(message.code)))),
        ("severity", FieldValue::One(Number::from(u64::from(message.severity)))),
        ("value", FieldValue::One(Number::from(message.value))),
        ("count", FieldValue::One(Number::from(message.as_str().len() as u64))),
        ("text", FieldValue::Text(message.as_str().to_string())),
    ])
}

/// Converts an event to a sample of its topic, with its number among the displayed events.
pub(super) fn line<'a>(
    run: &'a LivingRun,
    record: &EventRecord,
    sequence: u64,
    value: &'a Content<'a>,
) -> Line<'a> {
    let time_ns = match (run.plan.clock, record.simulated_ns) {
        (ClockKind::Lockstep, Some(simulated_ns)) => simulated_ns,
        _ => record.time_ns,
    };
    let now_ns = if run.plan.clock == ClockKind::Lockstep { run.now_ns() } else { monotonic_ns() };
    let component = record.component.and_then(|index| run.plan.components.get(index));
    Line {
        topic: TOPIC,
        sequence,
        time_s: time_ns.saturating_sub(run.start_ns()) as f64 * 1e-9,
        publish_time_ns: time_ns,
        source_time_ns: time_ns,
        age_ns: now_ns.saturating_sub(time_ns),
        publisher: component.map(|component| component.name.as_str()),
        restart_count: 0,
        joints: None,
        episode: record.episode,
        value,
    }
}

/// Returns the row of the log in the list of topics.
pub(super) fn row(run: &LivingRun, before: u64, seconds: f64) -> Row {
    let count = run.region.events().count();
    Row {
        name: TOPIC.to_string(),
        type_name: Event::NAME.to_string(),
        pattern: "log".to_string(),
        writer: "(launcher)".to_string(),
        readers: Vec::new(),
        rate_hz: Some(count.saturating_sub(before) as f64 / seconds).filter(|rate| *rate > 0.0),
        published: count,
        dropped: 0,
        age_ns: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displayed_fields_are_fields_of_the_message() {
        let layout = Event::layout();
        let names: Vec<&str> = layout.fields.iter().map(|field| field.name.as_str()).collect();
        let shown = decoded(&Event::truncated("go"));
        for (name, _) in &shown.0 {
            assert!(names.contains(name), "{name} in {names:?}");
        }
        assert_eq!(shown.0.last(), Some(&("text", FieldValue::Text("go".to_string()))));
    }
}
