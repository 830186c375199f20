//! Events of a run as lines of text.

use motorium::launcher::Event;
use motorium::region::{EventKind, EventSeverity};

use crate::style;

/// Returns an event as a line of text; `None` for an event that is only logged.
pub(crate) fn event_line(event: &Event<'_>) -> Option<String> {
    if event.is_logged_only() {
        return None;
    }
    let heading = match event.kind()? {
        EventKind::Created => style::strong("motorium"),
        EventKind::Output => style::dim(format!("[{}]", event.component().unwrap_or_default())),
        EventKind::Failed => style::error("failed:"),
        EventKind::SafeStop => style::error("safe stop:"),
        EventKind::NotSafe => style::error("unsafe:"),
        EventKind::Stopped => style::warning("stopped:"),
        EventKind::Waiting => style::warning("waiting:"),
        _ if event.severity() == EventSeverity::Warning => style::warning("warning:"),
        _ => return Some(event.to_string()),
    };
    Some(format!("{heading} {event}"))
}
