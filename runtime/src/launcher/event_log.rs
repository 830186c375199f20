//! Event log of a run: writing of observed events, and reading with names and times.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Event, Launch};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, Plan};
use crate::region::{EventKind, EventReader, EventRecord, EventSeverity, Region};

/// The most events in a report.
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
    /// Real time of the event or its detection since the first step, s; negative before it.
    pub time_s: f64,
    /// In lockstep: simulated time in its episode, s; `null` in real time.
    #[serde(default)]
    pub simulated_s: Option<f64>,
    /// Number of the episode; `null` in logs of versions that did not number episodes of real time.
    #[serde(default)]
    pub episode: Option<u64>,
    /// Its severity.
    pub severity: EventSeverity,
    /// Affected component; `null` for the whole run.
    pub component: Option<String>,
    /// Its kind.
    pub kind: EventKind,
    /// Value as defined by its kind; otherwise 0.
    pub value: f64,
    /// Some words for people.
    pub text: String,
}

impl LoggedEvent {
    /// A record of the log of a run of this plan.
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

/// Returns the events of a run that are still in its log, oldest first, and the number of lost ones.
pub fn logged(plan: &Plan, region: &Region) -> (Vec<LoggedEvent>, u64) {
    let (records, lost) = region.events().all();
    (records.into_iter().map(|record| LoggedEvent::from_record(record, plan, region)).collect(), lost)
}

/// Writes observed events to the log of a run.
pub(super) struct EventWriter {
    region: Rc<Region>,
    clock: ClockKind,
    names: Vec<String>,
}

impl EventWriter {
    /// A writer into the log of a run of this plan.
    pub(super) fn new(plan: &Plan, region: Rc<Region>) -> Self {
        let names = plan.components.iter().map(|component| component.name.clone()).collect();
        Self { region, clock: plan.clock, names }
    }

    /// Writes an event, unless it is a status.
    pub(super) fn write(&self, event: &Event<'_>) {
        let Some(kind) = event.kind() else { return };
        let component = event.component().and_then(|name| self.names.iter().position(|other| other == name));
        let time_ns = match event {
            Event::EnteredSafeState { since_ns, .. } => *since_ns,
            // The detecting thread had real-time priority; this one may have been delayed.
            Event::Failed { seen_ns: Some(seen_ns), .. } => *seen_ns,
            // Of equal times, the less severe one is read first.
            Event::LeftSafeState { before_ns: Some(before_ns), .. } => *before_ns,
            _ => monotonic_ns(),
        };
        self.region.events().write(&EventRecord {
            time_ns,
            episode: self.region.header().episode.load(Relaxed),
            simulated_ns: (self.clock == ClockKind::Lockstep).then(|| self.simulated_ns()),
            severity: event.severity(),
            kind,
            component,
            value: event.value(),
            text: printable(event.to_string()),
        });
    }

    /// The simulated time that was handed out last, ns.
    fn simulated_ns(&self) -> u64 {
        let ticks = self.region.components().iter().map(|block| block.tick_time_ns.load(Relaxed));
        ticks.max().unwrap_or(0)
    }
}

/// Removes cursor control characters from a text.
fn printable(text: String) -> String {
    if text.contains(char::is_control) { text.replace(char::is_control, " ") } else { text }
}

/// An observer that logs events before it forwards them.
pub(super) fn logging<'a>(
    writer: &Rc<EventWriter>,
    observe: &'a mut dyn FnMut(Event<'_>),
) -> impl FnMut(Event<'_>) + use<'a> {
    let writer = writer.clone();
    move |event| {
        writer.write(&event);
        observe(event);
    }
}

impl Launch {
    /// The events since the last call of this reader.
    pub(crate) fn events(&self, reader: &mut EventReader) -> Vec<LoggedEvent> {
        let records = reader.read(self.region.events()).into_iter();
        records.map(|record| LoggedEvent::from_record(record, &self.plan, &self.region)).collect()
    }

    /// Returns the newest events for the report, and the number of omitted ones.
    pub(super) fn reported_events(&self) -> (Vec<LoggedEvent>, u64) {
        let (mut events, lost) = logged(&self.plan, &self.region);
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
}
