//! Writing of observed events to the log of a run.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use super::Event;
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, Plan};
use crate::region::{EventRecord, Region};

/// Writes observed events to the log of a run.
pub(super) struct EventWriter {
    region: Rc<Region>,
    clock: ClockKind,
    names: Vec<String>,
}

impl EventWriter {
    /// Creates a writer to the log of a run of this plan.
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
            // The detecting thread had real-time priority; this thread may have been delayed.
            Event::Failed { seen_ns: Some(seen_ns), .. } => *seen_ns,
            // At equal times, the less severe event is read first.
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

    /// Returns the last simulated time given to components, ns.
    fn simulated_ns(&self) -> u64 {
        let ticks = self.region.components().iter().map(|block| block.tick_time_ns.load(Relaxed));
        ticks.max().unwrap_or(0)
    }
}

/// Removes control characters from a text.
fn printable(text: String) -> String {
    if text.contains(char::is_control) { text.replace(char::is_control, " ") } else { text }
}

/// Returns an observer that logs events before it forwards them.
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
