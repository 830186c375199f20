//! The events of a run.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use motorium::region::EventKind;
use motorium_bridges::recording::{Analysis, EventLine};
use motorium_pictures::chart::{Chart, Series};
use motorium_pictures::escape;

/// Maximum number of events on the page.
const EVENTS: usize = 500;

/// Kinds of events of a run that was late or refused.
const MISSES: [EventKind; 4] =
    [EventKind::Missed, EventKind::LatencyMissed, EventKind::Refused, EventKind::LosesSteps];

/// Returns the late steps and refused commands: sums by cause over time, and each event.
pub(super) fn misses(analysis: &Analysis) -> String {
    let mut html = String::from("<h2>Misses</h2>\n");
    let missed = |event: &&EventLine| event.kind.is_some_and(|kind| MISSES.contains(&kind));
    let lines: Vec<_> = analysis.events.iter().filter(missed).collect();
    if lines.is_empty() {
        html += "<p class=dim>No deadline was missed and no command refused while it was recorded.</p>\n";
        return html;
    }
    html += &sums(&lines, analysis.duration_s).svg();
    html += "<table>\n";
    for event in lines {
        let _ =
            writeln!(html, "<tr><td class=n>{:.3} s</td><td>{}</td></tr>", event.time_s, escape(&event.text));
    }
    html += "</table>\n";
    html
}

/// Returns the number of misses of each kind until each time, as steps.
fn sums(events: &[&EventLine], duration_s: f64) -> Chart {
    let mut kinds: BTreeMap<&str, Vec<[f64; 3]>> = BTreeMap::new();
    for event in events {
        let points = kinds.entry(event.kind.map_or("other", EventKind::name)).or_default();
        let before = points.last().map_or(0.0, |point| point[1]);
        points.extend([[event.time_s, before, 0.0], [event.time_s, before + event.value.max(1.0), 0.0]]);
    }
    let series = kinds.into_iter().map(|(name, mut points)| {
        let sum = points.last().map_or(0.0, |point| point[1]);
        points.push([duration_s, sum, 0.0]);
        Series { name: format!("{name}: {sum}"), points }
    });
    Chart {
        title: "Misses until each time".to_string(),
        x: "time, s".to_string(),
        y: "misses".to_string(),
        log_x: false,
        log_y: false,
        series: series.collect(),
    }
}

/// Returns all events, or the first of very many.
pub(super) fn section(analysis: &Analysis) -> String {
    let mut html = String::from("<h2>Events</h2>\n<table>\n");
    for event in analysis.events.iter().take(EVENTS) {
        let class = match event.severity {
            0 => "dim",
            1 => "warning",
            _ => "error",
        };
        let _ = writeln!(
            html,
            "<tr class={class}><td class=n>{:.3} s</td><td>{}</td><td>{}</td></tr>",
            event.time_s,
            event.kind.map_or("other", EventKind::name),
            escape(&event.text)
        );
    }
    html.push_str("</table>\n");
    if analysis.events.len() > EVENTS {
        let _ = writeln!(html, "<p class=dim>{} more</p>", analysis.events.len() - EVENTS);
    }
    html
}
