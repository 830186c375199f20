//! Events of a run as lines of text.

use motorium::launcher::Event;
use motorium::plan::ClockKind;

use crate::style;

/// An event as a line of text; `None` for a status, which is only shown as a table.
pub(crate) fn event_line(event: &Event<'_>) -> Option<String> {
    let line = match event {
        Event::Created { run, plan } => {
            let clock = match plan.clock {
                ClockKind::Realtime => "in real time",
                ClockKind::Lockstep => "in lockstep",
            };
            format!(
                "{} {}: {} components {clock} (run {run})",
                style::strong("motorium"),
                plan.name,
                plan.components.len()
            )
        }
        Event::Lost(what) => format!("{} {what}", style::warning("warning:")),
        Event::Started => "all ports connected, running".to_string(),
        Event::Output { component, line } => format!("{} {line}", style::dim(format!("[{component}]"))),
        Event::Failed { component, tick, reason, consequence } => {
            format!("{} `{component}` at tick {tick}: {reason}; {consequence}", style::error("failed:"))
        }
        Event::Restarted { component, after_ns } => {
            format!("`{component}` steps again after {:.1} ms", *after_ns as f64 * 1e-6)
        }
        Event::SafeStop { reason } => format!("{} {reason}", style::error("safe stop:")),
        Event::Safe { after_ns } => {
            format!("all actuators in their safe state after {:.2} ms", *after_ns as f64 * 1e-6)
        }
        Event::Status(_) => return None,
    };
    Some(line)
}
