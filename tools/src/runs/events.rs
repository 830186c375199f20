//! Events of a run as lines of text.

use motorium::launcher::Event;
use motorium::plan::ClockKind;
use motorium::region::Latch;

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
        Event::NotSafe { dead, late, safe } => {
            let names =
                |names: &[&str]| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            let parts = [(dead, "dead"), (late, "not in its safe state"), (safe, "in its safe state")];
            let parts: Vec<String> = parts
                .iter()
                .filter(|(those, _)| !those.is_empty())
                .map(|(those, what)| format!("{} {what}", names(those)))
                .collect();
            format!(
                "{} not all actuators are in their safe state: {}",
                style::error("unsafe:"),
                parts.join("; ")
            )
        }
        Event::Stopped { latch, cause } => {
            let first = match latch {
                Latch::EmergencyStop => "release the emergency stop, then ",
                Latch::Stop | Latch::SafeState => "",
            };
            format!(
                "{} the robot stays in its safe state, {cause}; to go on: {first}`motorium resume`",
                style::warning("stopped:")
            )
        }
        Event::Resumed => "resumed: the robot comes back to its commands".to_string(),
        Event::LosesSteps { component, share } => format!(
            "{} `{component}` lost {:.1} % of its steps in the last second",
            style::warning("warning:"),
            100.0 * share
        ),
        Event::Waiting { component, tick, for_ns } => format!(
            "{} `{component}` has been in tick {tick} for {:.1} s; simulated time stands still until it ends (Ctrl-C stops)",
            style::warning("waiting:"),
            *for_ns as f64 * 1e-9
        ),
        Event::Warning(what) => format!("{} {what}", style::warning("warning:")),
        Event::Status(_) => return None,
    };
    Some(line)
}
