//! Rates and latencies of the topics.

use std::fmt::Write as _;

use motorium_bridges::recording::{Analysis, quantile};
use motorium_pictures::chart::{Chart, Series};
use motorium_pictures::escape;

use crate::report::microseconds;

/// Bars of a histogram.
const BARS: usize = 40;

/// Returns the table of topics, their latencies over time, and histograms.
pub(super) fn section(analysis: &Analysis) -> String {
    let mut html = String::new();
    html.push_str(
        "<h2>Topics</h2>\n<table>\n<tr><th>topic</th><th>type</th><th class=n>samples</th><th class=n>missing</th>\
         <th class=n>interval p50 / p99 / max, us</th><th class=n>latency p50 / p99 / max, us</th></tr>\n",
    );
    for topic in &analysis.topics {
        let three = |values: &[u64]| match values.is_empty() {
            true => "-".to_string(),
            false => {
                [0.5, 0.99, 1.0].map(|part| microseconds(quantile(values, part)).to_string()).join(" / ")
            }
        };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td></tr>",
            escape(&topic.name),
            escape(&topic.type_name),
            topic.samples,
            topic.gaps,
            three(&topic.interval_ns),
            if is_timed(&topic.latency_ns) { three(&topic.latency_ns) } else { "-".to_string() }
        );
    }
    html.push_str("</table>\n");
    html += &latencies(analysis).map(|chart| chart.svg()).unwrap_or_default();
    let mut histograms = String::new();
    for topic in &analysis.topics {
        for (what, values) in [("interval", &topic.interval_ns), ("latency", &topic.latency_ns)] {
            if let Some(chart) = histogram(&format!("{}: {what}", topic.name), values) {
                histograms += &chart.svg();
            }
        }
    }
    if !histograms.is_empty() {
        let _ = write!(html, "<details><summary>Histograms</summary>\n{histograms}</details>\n");
    }
    html
}

/// Returns the latencies of all topics over time, which show rare late samples; `None` in lockstep.
fn latencies(analysis: &Analysis) -> Option<Chart> {
    let timed = analysis.topics.iter().filter(|topic| is_timed(&topic.latency_ns));
    let series = timed.map(|topic| Series {
        name: topic.name.clone(),
        points: topic.latencies.points().into_iter().map(|(time, ns)| [time, 1e-3 * ns, 0.0]).collect(),
    });
    let series: Vec<Series> = series.collect();
    (!series.is_empty()).then(|| Chart {
        title: "Latency over time".to_string(),
        x: "time, s".to_string(),
        y: "source to publication, us".to_string(),
        log_x: false,
        log_y: true,
        series,
    })
}

/// Returns the histogram of rising times; `None` if all are equal, as they are in lockstep.
fn histogram(title: &str, rising: &[u64]) -> Option<Chart> {
    let (first, last) = (*rising.first()?, *rising.last()?);
    if first == last {
        return None;
    }
    let width = (last - first) as f64 / BARS as f64;
    let mut counts = [0u64; BARS];
    for value in rising {
        let bar = ((value - first) as f64 / width) as usize;
        counts[bar.min(BARS - 1)] += 1;
    }
    let edge = |bar: usize| (first as f64 + bar as f64 * width) * 1e-3;
    // Drawn as steps, from a count of 1, so that rare late samples are visible.
    let points = counts.iter().enumerate().flat_map(|(bar, count)| {
        let height = (*count as f64).max(0.5);
        [[edge(bar), height, 0.0], [edge(bar + 1), height, 0.0]]
    });
    Some(Chart {
        title: title.to_string(),
        x: "time, us".to_string(),
        y: "samples".to_string(),
        log_x: false,
        log_y: true,
        series: vec![Series { name: format!("{} samples", rising.len()), points: points.collect() }],
    })
}

/// Returns `true` if latencies were measured: in lockstep, all of them are 0.
pub(super) fn is_timed(latencies: &[u64]) -> bool {
    latencies.iter().any(|latency| *latency > 0)
}
