//! `motorium report`: a recording as one page.

mod events;
mod film;
mod reached;
mod results;
mod topics;
mod tracking;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::launcher::Report as RunReport;
use motorium::plan::Plan;
use motorium_bridges::recording::{Analysis, Opened, Recording, Tolerance, TopicAnalysis, analyse, quantile};
use motorium_pictures::graph::{self, Measured};

use crate::out::errln;
use crate::output::{refuse_existing, write_file};
use crate::report::microseconds;
use crate::{html, input};
use topics::is_timed;

/// Write a page about a recording: the robots in motion, the score, the graph with measured values, latencies
/// and misses over time, tracking, events.
///
/// The page is one file and needs no network; it follows a dark theme and prints on white. For an MCAP file
/// of another program, it lists the channels and draws their numbers.
///
/// Example: motorium report out/a.mcap --output out/a.html
#[derive(Debug, clap::Args)]
pub(crate) struct Report {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The page to write [default: FILE with `.html` in place of `.mcap`]
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Replace the page if it exists
    #[arg(long)]
    overwrite: bool,
    /// Add the results of all components, from the report that `motorium run --json` printed
    #[arg(long, value_name = "FILE.json")]
    results: Option<PathBuf>,
}

impl Report {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let output = self.output.unwrap_or_else(|| self.file.with_extension("html"));
        refuse_existing(&output, self.overwrite)?;
        let (page, topics, duration) = match super::opened_any(&self.file)? {
            Opened::Run(recording) => {
                let plan = recording.plan()?;
                let analysis = analyse(&recording, &plan)?;
                let results = self.results.as_deref().map(|file| report_of_run(file, &plan)).transpose()?;
                let page = page(&recording, &plan, &analysis, results.as_ref())?;
                (page, analysis.topics.len(), analysis.duration_s)
            }
            Opened::Other(log) => {
                anyhow::ensure!(
                    self.results.is_none(),
                    "--results belongs to a run of motorium; {} was written by another program",
                    self.file.display()
                );
                let duration = log.times().map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9);
                (super::log::page(&log), log.channels().len(), duration)
            }
        };
        write_file(&output, page)?;
        errln!("{}: {topics} topics, {duration:.3} s", output.display());
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the report of the run of this plan.
fn report_of_run(file: &Path, plan: &Plan) -> anyhow::Result<RunReport> {
    let report: RunReport = serde_json::from_slice(&input::bytes(file)?)
        .with_context(|| format!("{}: expected the output of `motorium run --json`", file.display()))?;
    anyhow::ensure!(
        report.graph == plan.name,
        "{} is the report of graph `{}`, expected `{}`",
        file.display(),
        report.graph,
        plan.name
    );
    Ok(report)
}

fn page(
    recording: &Recording,
    plan: &Plan,
    analysis: &Analysis,
    results: Option<&RunReport>,
) -> anyhow::Result<String> {
    let mut body = facts(recording, analysis);
    body += &film::strip(recording, plan)?;
    let score = analysis.score(recording, plan, Tolerance::default())?;
    body += &reached::goals(&score);
    body += "<h2>Graph</h2>\n";
    body += &graph::svg(plan, Some(&measured(plan, analysis)));
    body += &topics::section(analysis);
    body += &events::misses(analysis);
    for tracking in &analysis.tracking {
        body += &tracking::section(plan, tracking);
    }
    body += &reached::limits(&score);
    if let Some(report) = results {
        body += &results::section(report);
    }
    body += &events::section(analysis);
    Ok(html::page(&plan.name, &body))
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

/// Returns the measured values on the picture of the graph.
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
