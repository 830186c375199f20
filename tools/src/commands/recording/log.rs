//! Report page of an MCAP file of another program: its channels, and their numbers over time.

use std::fmt::Write as _;

use motorium_bridges::recording::{Curve, OtherLog, Signal, quantile};
use motorium_pictures::chart::{Chart, Series};
use motorium_pictures::escape;

use crate::html;
use crate::report::microseconds;

/// Maximum number of curves of a chart.
const CURVES: usize = 12;
/// Maximum number of charts of a channel.
const CHARTS: usize = 12;
/// Maximum number of points of a curve.
const POINTS: usize = 1000;

/// Returns the page of a file.
pub(super) fn page(log: &OtherLog) -> String {
    let times = log.message_times();
    let count: usize = times.iter().map(Vec::len).sum();
    let (first, last) = log.times().unwrap_or((0, 0));
    let mut body = html::facts([
        ("file", log.path().display().to_string()),
        ("written by", if log.writer().is_empty() { "unknown" } else { log.writer() }.to_string()),
        ("first message", format!("{:.3} s since the epoch of its clock", first as f64 * 1e-9)),
        ("duration", format!("{:.3} s", (last - first) as f64 * 1e-9)),
        ("messages", count.to_string()),
    ]);
    channels(&mut body, log, &times);
    for (index, channel) in log.channels().iter().enumerate() {
        if channel.decoder.is_err() || times[index].is_empty() {
            continue;
        }
        let _ = writeln!(body, "<h2>{}</h2>", escape(&channel.topic));
        let all = Signal { topic: channel.topic.clone(), field: None, entries: None };
        match log.curves(&[all]) {
            Ok(curves) => charts(&mut body, &channel.topic, &curves),
            Err(error) => {
                let _ = writeln!(body, "<p class=warning>{}</p>", escape(&error.to_string()));
            }
        }
    }
    let name = log.path().file_stem().map(|stem| stem.to_string_lossy().into_owned());
    html::page(&name.unwrap_or_default(), &body)
}

fn channels(html: &mut String, log: &OtherLog, times: &[Vec<u64>]) {
    html.push_str(
        "<h2>Channels</h2>\n<div class=wide><table>\n<tr><th>channel</th><th>schema</th><th>encoding</th>\
         <th class=n>messages</th><th class=n>interval p50 / p99 / max, us</th></tr>\n",
    );
    for (channel, times) in log.channels().iter().zip(times) {
        let mut intervals: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        intervals.sort_unstable();
        let interval = match intervals.is_empty() {
            true => "-".to_string(),
            false => [0.5, 0.99, 1.0].map(|part| microseconds(quantile(&intervals, part))).join(" / "),
        };
        let schema = channel.schema.as_ref().map_or("-", |schema| schema.name.as_str());
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td class=n>{}</td><td class=n>{interval}</td></tr>",
            escape(&channel.topic),
            escape(schema),
            escape(&channel.encoding),
            channel.messages,
        );
        if let Err(reason) = &channel.decoder {
            let reason = escape(&reason.to_string());
            let _ = writeln!(html, "<tr class=warning><td colspan=5>not decoded: {reason}</td></tr>");
        }
    }
    html.push_str("</table></div>\n");
}

/// Returns the part of the name of a curve that is the title of its chart: without the last index or name.
fn group(name: &str) -> &str {
    match name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) {
        Some((array, _)) => array,
        None => name.rsplit_once('.').map_or(name, |(group, _)| group),
    }
}

fn charts(html: &mut String, topic: &str, curves: &[Curve]) {
    let mut groups: Vec<(&str, Vec<&Curve>)> = Vec::new();
    for curve in curves {
        let name = group(&curve.name);
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, members)) => members.push(curve),
            None => groups.push((name, vec![curve])),
        }
    }
    for (title, members) in groups.iter().take(CHARTS) {
        let of_topic = title.strip_prefix(topic).unwrap_or(title).trim_start_matches('.');
        let chart = Chart {
            title: if of_topic.is_empty() { (*title).to_string() } else { of_topic.to_string() },
            x: "time, s".to_string(),
            y: String::new(),
            log_x: false,
            log_y: false,
            series: members
                .iter()
                .take(CURVES)
                .map(|curve| Series {
                    name: curve.label.clone().unwrap_or_else(|| {
                        curve
                            .name
                            .strip_prefix(title)
                            .unwrap_or(&curve.name)
                            .trim_start_matches('.')
                            .to_string()
                    }),
                    points: curve
                        .thinned(POINTS)
                        .into_iter()
                        .map(|(time, value)| [time, value, 0.0])
                        .collect(),
                })
                .collect(),
        };
        html.push_str(&chart.svg());
        if members.len() > CURVES {
            let _ = writeln!(html, "<p class=dim>{} more numbers</p>", members.len() - CURVES);
        }
    }
    if groups.len() > CHARTS {
        let _ = writeln!(html, "<p class=dim>{} more groups of numbers</p>", groups.len() - CHARTS);
    }
}
