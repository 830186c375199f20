//! `motorium report`: a recording as one page.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::plan::Plan;
use motorium_bridges::foxglove::joints_of_topic;
use motorium_bridges::recording::{Analysis, Opened, Recording, TopicAnalysis, Tracking, analyse, quantile};

use crate::chart::{Chart, Series};
use crate::draw::{self, Measured, escape};
use crate::html;
use crate::out::errln;
use crate::report::microseconds;

/// Bars of a histogram.
const BARS: usize = 40;
/// Most events on the page.
const EVENTS: usize = 500;

/// Write a page about a recording: its graph with measured values, latencies, tracking errors, events.
///
/// The page is one file and needs no network. Of an MCAP file of another program it lists the channels and
/// draws their numbers.
///
/// Example: motorium report out/a.mcap --output out/a.html
#[derive(Debug, clap::Args)]
pub(crate) struct Report {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The page [default: FILE with `.html` in place of `.mcap`]
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
}

impl Report {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let (page, topics, duration) = match super::opened_any(&self.file)? {
            Opened::Run(recording) => {
                let plan = recording.plan()?;
                let analysis = analyse(&recording, &plan)?;
                (page(&recording, &plan, &analysis), analysis.topics.len(), analysis.duration_s)
            }
            Opened::Other(log) => {
                let duration = log.times().map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9);
                (super::log::page(&log), log.channels().len(), duration)
            }
        };
        let output = self.output.unwrap_or_else(|| self.file.with_extension("html"));
        if let Some(folder) = output.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        }
        std::fs::write(&output, page).with_context(|| format!("writing {}", output.display()))?;
        errln!("{}: {topics} topics, {duration:.3} s", output.display());
        Ok(ExitCode::SUCCESS)
    }
}

fn page(recording: &Recording, plan: &Plan, analysis: &Analysis) -> String {
    let mut body = facts(recording, analysis);
    body += "<h2>Graph</h2>\n";
    body += &draw::svg(plan, Some(&measured(plan, analysis)));
    topics(&mut body, analysis);
    misses(&mut body, analysis);
    tracking(&mut body, plan, analysis);
    events(&mut body, analysis);
    html::page(&plan.name, &body)
}

fn facts(recording: &Recording, analysis: &Analysis) -> String {
    let fact = |name: &str| recording.fact(name).unwrap_or("unknown").to_string();
    let machine: serde_json::Value = recording
        .attachment("machine.json")
        .and_then(|text| serde_json::from_slice(text).ok())
        .unwrap_or_default();
    let of_machine = |name: &str| machine[name].as_str().unwrap_or("unknown").to_string();
    let samples: u64 = analysis.topics.iter().map(|topic| topic.samples).sum();
    let gaps: u64 = analysis.topics.iter().map(|topic| topic.gaps).sum();
    let end = if recording.is_whole() { "" } else { " (the file is incomplete)" };
    html::facts([
        ("file", recording.path().display().to_string()),
        ("graph", fact("file")),
        ("clock", fact("clock")),
        ("seed", fact("seed")),
        ("duration", format!("{:.3} s{end}", analysis.duration_s)),
        ("samples", format!("{samples}, {gaps} missing")),
        ("motorium", fact("version")),
        ("processor", of_machine("processor")),
        ("kernel", of_machine("kernel")),
    ])
}

/// The measured values on the picture of the graph.
fn measured(plan: &Plan, analysis: &Analysis) -> Measured {
    let of = |index: usize| analysis.topics.iter().find(|topic| topic.name == plan.topics[index].name);
    let latency = |topic: &TopicAnalysis| {
        let at = |part| microseconds(quantile(&topic.latency_ns, part));
        is_timed(&topic.latency_ns).then(|| format!("latency p50 {} / p99 {} us", at(0.5), at(0.99)))
    };
    let rate = |component: usize| {
        let topics = plan.topics.iter().enumerate().filter(|(_, topic)| topic.writer == component);
        let most = topics.filter_map(|(index, _)| of(index)).max_by_key(|topic| topic.samples)?;
        let intervals = &most.interval_ns;
        let mean_ns = intervals.iter().sum::<u64>() as f64 / intervals.len() as f64;
        (mean_ns > 0.0).then(|| format!("{:.1} Hz", 1e9 / mean_ns))
    };
    let budget = |budget: &motorium::plan::LatencyPlan| {
        let topic = of(budget.to).filter(|topic| is_timed(&topic.latency_ns))?;
        let missed = topic.latency_ns.iter().filter(|latency| **latency > budget.max_ns).count();
        let p99 = microseconds(quantile(&topic.latency_ns, 0.99));
        Some(format!("p99 {p99} us, {missed} missed"))
    };
    Measured {
        rates: (0..plan.components.len()).map(rate).collect(),
        topics: (0..plan.topics.len()).map(|index| of(index).and_then(latency)).collect(),
        latencies: plan.latencies.iter().map(budget).collect(),
    }
}

/// True if latencies were measured: in lockstep, where time stands still, all of them are 0.
fn is_timed(latencies: &[u64]) -> bool {
    latencies.iter().any(|latency| *latency > 0)
}

fn topics(html: &mut String, analysis: &Analysis) {
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
    for topic in &analysis.topics {
        for (what, values) in [("interval", &topic.interval_ns), ("latency", &topic.latency_ns)] {
            if let Some(chart) = histogram(&format!("{}: {what}", topic.name), values) {
                html.push_str(&chart.svg());
            }
        }
    }
}

/// The histogram of rising times; `None` if all are equal, as they are in lockstep.
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
    // Drawn as steps, from a count of 1: the rare late ones are what matters.
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

/// Events of a run that was late or refused, by their words.
fn misses(html: &mut String, analysis: &Analysis) {
    html.push_str("<h2>Misses</h2>\n");
    let kinds = ["missed", "latency_missed", "refused", "loses_steps"];
    let lines: Vec<_> = analysis.events.iter().filter(|event| kinds.contains(&event.kind)).collect();
    if lines.is_empty() {
        html.push_str(
            "<p class=dim>No deadline was missed and no command refused while it was recorded.</p>\n",
        );
        return;
    }
    html.push_str("<table>\n");
    for event in lines {
        let _ =
            writeln!(html, "<tr><td class=n>{:.3} s</td><td>{}</td></tr>", event.time_s, escape(&event.text));
    }
    html.push_str("</table>\n");
}

fn tracking(html: &mut String, plan: &Plan, analysis: &Analysis) {
    for Tracking { command, state, joints } in &analysis.tracking {
        let index = plan.topics.iter().position(|topic| topic.name == *state);
        let names = index.and_then(|index| joints_of_topic(plan, index)).unwrap_or_default();
        let _ = writeln!(
            html,
            "<h2>Tracking: {} after {}</h2>\n<table>\n<tr><th>joint</th><th class=n>root mean square, rad or m</th>\
             <th class=n>greatest</th></tr>",
            escape(state),
            escape(command)
        );
        for (joint, (rms, most)) in joints.iter().enumerate() {
            let name = names.get(joint).cloned().unwrap_or_else(|| joint.to_string());
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td class=n>{rms:.3e}</td><td class=n>{most:.3e}</td></tr>",
                escape(&name)
            );
        }
        html.push_str("</table>\n");
    }
}

fn events(html: &mut String, analysis: &Analysis) {
    html.push_str("<h2>Events</h2>\n<table>\n");
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
            event.kind,
            escape(&event.text)
        );
    }
    html.push_str("</table>\n");
    if analysis.events.len() > EVENTS {
        let _ = writeln!(html, "<p class=dim>{} more</p>", analysis.events.len() - EVENTS);
    }
}
