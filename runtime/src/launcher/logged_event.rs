//! Logged events of a run, with names and times.

use std::sync::atomic::Ordering::Relaxed;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::plan::Plan;
use crate::region::{EventKind, EventReader, EventRecord, EventSeverity, Region};

/// Maximum number of events in a report.
pub const REPORTED_EVENTS: usize = 256;

/// A logged event of a run.
///
/// ```
/// use motorium::launcher::LoggedEvent;
///
/// let text = r#"{"time_s": 1.25, "severity": "warning", "component": "physics", "kind": "refused", "value": 3.0,
///     "text": "`physics` refused 3 commands: 3 beyond a limit"}"#;
/// let event: LoggedEvent = serde_json::from_str(text)?;
/// assert_eq!(event.component.as_deref(), Some("physics"));
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoggedEvent {
    /// Real time from the first step of the run to the occurrence or detection of the event, s; negative
    /// before the first step.
    pub time_s: f64,
    /// In lockstep, simulated time in the episode, s; `null` in real time.
    #[serde(default)]
    pub simulated_s: Option<f64>,
    /// Index of the episode; `null` in old logs of real-time runs, whose episodes were not numbered.
    #[serde(default)]
    pub episode: Option<u64>,
    /// Severity of the event.
    pub severity: EventSeverity,
    /// Name of the affected component; `null` if the event concerns the whole run.
    pub component: Option<String>,
    /// Kind of the event.
    pub kind: EventKind,
    /// Value of the event, as defined by its kind; 0 for kinds without a value.
    pub value: f64,
    /// Description of the event.
    pub text: String,
}

impl LoggedEvent {
    /// Converts a record from the event log of a run of this plan.
    pub fn from_record(record: EventRecord, plan: &Plan, region: &Region) -> Self {
        // Before the first step, only the time of the run's creation is known.
        let start_ns = match region.header().start_ns.load(Relaxed) {
            0 => region.events().opened_ns(),
            start_ns => start_ns,
        };
        Self {
            time_s: record.time_ns.wrapping_sub(start_ns) as i64 as f64 * 1e-9,
            simulated_s: record.simulated_ns.map(|ns| ns as f64 * 1e-9),
            episode: Some(record.episode),
            severity: record.severity,
            component: record
                .component
                .and_then(|index| plan.components.get(index))
                .map(|component| component.name.clone()),
            kind: record.kind,
            value: record.value,
            text: record.text,
        }
    }
}

/// Returns the events of a run that are still in its log, oldest first, and the number of overwritten events.
pub fn logged(plan: &Plan, region: &Region) -> (Vec<LoggedEvent>, u64) {
    let (records, lost) = region.events().all();
    (records.into_iter().map(|record| LoggedEvent::from_record(record, plan, region)).collect(), lost)
}

/// Returns the events since the last call with this reader.
pub(super) fn unread_events(reader: &mut EventReader, plan: &Plan, region: &Region) -> Vec<LoggedEvent> {
    let records = reader.read(region.events()).into_iter();
    records.map(|record| LoggedEvent::from_record(record, plan, region)).collect()
}

/// Returns the newest events for the report, and the number of omitted ones.
pub(super) fn reported_events(plan: &Plan, region: &Region) -> (Vec<LoggedEvent>, u64) {
    let (mut events, lost) = logged(plan, region);
    let more = events.len().saturating_sub(REPORTED_EVENTS);
    // Events of the run take precedence over printed lines.
    let mut lines = more;
    events.retain(|event| {
        let goes = lines > 0 && event.kind == EventKind::Output;
        lines -= usize::from(goes);
        !goes
    });
    events.drain(..lines);
    (events, lost + more as u64)
}
