//! The report of a run as text.

mod results;

use std::fmt::Write as _;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use motorium::launcher::{ComponentReport, Exit, Report};
use motorium::plan::ClockKind;
use motorium::telemetry::Percentiles;

use crate::wrap::wrapped;
use crate::{gate, style};

use results::WIDTH;
pub(crate) use results::{decimal, items, warnings};

/// Returns a table without lines, with two blanks between columns.
pub(crate) fn table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    table
}

fn right_from(table: &mut Table, first: usize) {
    for column in table.column_iter_mut().skip(first) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// Returns a duration in microseconds, three digits.
pub(crate) fn microseconds(ns: u64) -> String {
    let us = ns as f64 * 1e-3;
    match us {
        x if x < 0.1 => format!("{us:.3}"),
        x if x < 100.0 => format!("{us:.1}"),
        _ => format!("{us:.0}"),
    }
}

fn percentiles(p: &Percentiles) -> String {
    let parts = [p.p50, p.p99, p.p999, p.max].map(microseconds);
    parts.join(" / ")
}

pub(crate) fn short_percentiles(p: &Percentiles) -> String {
    [p.p50, p.p99, p.max].map(microseconds).join(" / ")
}

/// Formats a counter with its noun in singular or plural; `None` for 0.
fn counted(count: u64, one: &str, several: &str) -> Option<String> {
    (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { several }))
}

/// Adds the counters of each component that are zero in a healthy run, if they are not zero.
fn counters(report: &Report, text: &mut String) {
    for c in &report.components {
        let words = [
            counted(c.misses.skipped, "step skipped", "steps skipped"),
            counted(u64::from(c.restarts), "restart", "restarts"),
            counted(c.allocations.unwrap_or(0), "allocation", "allocations"),
            counted(c.allocations_apart.unwrap_or(0), "known allocation", "known allocations"),
            counted(c.page_faults, "page fault", "page faults"),
            c.allocations.is_none().then(|| "allocations not counted".to_string()),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        if !words.is_empty() {
            let _ = writeln!(text, "{}: {}", c.name, words.join(", "));
        }
    }
}

/// Returns the closing summary of a run.
pub(crate) fn summary(report: &Report) -> String {
    let mut text = String::new();
    let how = match &report.exit {
        Exit::Finished => style::good("finished"),
        Exit::Interrupted => style::warning("interrupted"),
        Exit::SafeStop { .. } => style::error("safe stop"),
    };
    let _ = write!(text, "\n{} {how} after {:.1} s", style::strong(&report.graph), report.duration_s);
    if report.clock == ClockKind::Lockstep {
        let _ = write!(text, " of simulated time in {:.1} s", report.duration_s / report.realtime_factor);
    }
    if let Some(hash) = &report.state_hash {
        let _ = write!(text, ", state hash {hash}");
    }
    text.push_str("\n\n");
    for episode in &report.episodes {
        let (index, seed) = (episode.index, episode.seed);
        let (steps, time) = (episode.steps, episode.duration_s);
        let _ = write!(text, " episode {index}: seed {seed}, {time:.3} s, {steps} steps");
        if let Some(hash) = &episode.state_hash {
            let _ = write!(text, ", state hash {hash}");
        }
        text.push('\n');
    }
    if !report.episodes.is_empty() {
        text.push('\n');
    }
    let realtime = report.clock == ClockKind::Realtime;
    text.push_str(&components(report, realtime));
    counters(report, &mut text);
    missed_steps(report, &mut text);
    for c in &report.components {
        if let Some(words) = c.gate.as_ref().and_then(gate::describe) {
            let _ = writeln!(text, "{}: {words}", c.name);
        }
    }
    interrupted(report, &mut text);
    // a lockstep run has no latency: simulated time does not advance while components step
    for latency in report.latencies.iter().filter(|_| realtime) {
        let _ = writeln!(
            text,
            "latency {} -> {}: {} us (p50/p99/p99.9/max), budget {} us, missed {} of {}",
            latency.from,
            latency.to,
            percentiles(&latency.latency_ns),
            microseconds(latency.max_ns),
            latency.missed,
            latency.count
        );
    }
    if !report.expectations.is_empty() {
        let met = report.expectations.iter().filter(|expectation| expectation.met).count();
        let _ = writeln!(text, "expectations: {met} of {} met", report.expectations.len());
    }
    for (name, result) in &report.results {
        let lines = results::lines(name.chars().count() + 2, result);
        let _ = writeln!(text, "{} {lines}", style::strong(format!("{name}:")));
    }
    wrapped(&text, WIDTH)
}

/// Returns the table of components, of at most [`WIDTH`] columns; two tables if the times do not fit next to
/// the steps.
fn components(report: &Report, realtime: bool) -> String {
    type Cell = fn(&ComponentReport) -> String;
    const STEPS: (&str, Cell) = ("steps", |c| c.steps.to_string());
    const RATE: (&str, Cell) = ("Hz", |c| format!("{:.1}", c.rate_hz));
    const LATE: (&str, Cell) = ("late us p50/p99/max", |c| short_percentiles(&c.lateness_ns));
    const STEP: (&str, Cell) = ("step us p50/p99/max", |c| short_percentiles(&c.execution_ns));
    const MISSED: (&str, Cell) = ("missed", |c| c.misses.missed().to_string());
    let rendered = |columns: &[(&str, Cell)]| {
        let mut rows = Table::new();
        rows.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
        rows.set_header(core::iter::once("component").chain(columns.iter().map(|(name, _)| *name)));
        for c in &report.components {
            rows.add_row(core::iter::once(c.name.clone()).chain(columns.iter().map(|(_, cell)| cell(c))));
        }
        right_from(&mut rows, 1);
        format!("{}\n", rows.trim_fmt())
    };
    if !realtime {
        return rendered(&[STEPS, STEP]);
    }
    let one = rendered(&[STEPS, RATE, LATE, STEP, MISSED]);
    match one.lines().all(|line| line.chars().count() <= WIDTH) {
        true => one,
        false => rendered(&[STEPS, RATE, MISSED]) + "\n" + &rendered(&[LATE, STEP]),
    }
}

/// Adds the interrupts on cores with steps that were too long: the kernel charges the time of interrupts to
/// the step.
fn interrupted(report: &Report, text: &mut String) {
    let long: u64 = report.components.iter().map(|component| component.misses.long_step).sum();
    for core in report.cores.iter().filter(|_| long > 0) {
        let mut kinds: Vec<(&String, &u64)> = core.interrupts.iter().collect();
        kinds.sort_by_key(|(name, count)| (core::cmp::Reverse(**count), *name));
        let kinds: Vec<String> =
            kinds.iter().take(4).map(|(name, count)| format!("{count} {name}")).collect();
        let _ = writeln!(
            text,
            "core {}: {} interrupts ({}), the host took {:.0} ms",
            core.core,
            core.interrupts_in_all(),
            kinds.join(", "),
            core.steal_ms
        );
    }
}

/// Lists the causes of missed steps; delays by the host are distinguished from the graph's own.
fn missed_steps(report: &Report, text: &mut String) {
    for component in &report.components {
        let causes = causes(component);
        if !causes.is_empty() {
            let _ = writeln!(text, "{}: {}", component.name, causes.join(", "));
        }
    }
}

/// Counts of late, deferred, tolerated and refused steps and samples of a component, with their causes.
pub(crate) fn causes(component: &ComponentReport) -> Vec<String> {
    let misses = &component.misses;
    [
        (misses.stolen, "delayed by the host"),
        (misses.late_wake, "delayed by others on its core"),
        (misses.long_step, "step too long"),
        (misses.late_input, "stale command, safe state applied"),
        (misses.over_budget, "over budget"),
        (component.deferred, "events deferred by `min_interval`"),
        (component.errors, "errors tolerated"),
        (component.refused, "samples refused"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, cause)| format!("{count} {cause}"))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A report with the longest names and the largest realistic figures.
    fn large(clock: &str, figure: u64) -> Report {
        let times =
            serde_json::json!({ "p50": figure, "p99": figure * 10, "p999": figure * 10, "max": figure * 90 });
        let mut report: serde_json::Value = serde_json::from_str(include_str!("large.json")).expect("JSON");
        report["clock"] = clock.into();
        for component in report["components"].as_array_mut().expect("components") {
            component["lateness_ns"] = times.clone();
            component["execution_ns"] = times.clone();
        }
        report["latencies"][0]["latency_ns"] = times;
        serde_json::from_value(report).expect("a report")
    }

    #[test]
    fn no_line_of_a_summary_is_wider_than_80_columns() {
        for clock in ["realtime", "lockstep"] {
            for figure in [900, 90_000, 9_000_000, 900_000_000] {
                let text = anstream::adapter::strip_str(&summary(&large(clock, figure))).to_string();
                for line in text.lines() {
                    assert!(line.chars().count() <= WIDTH, "{clock}, {figure} ns: {line}");
                }
                assert!(text.contains("left_shoulder_controller") && text.contains("steps"), "{text}");
            }
        }
    }

    #[test]
    fn lockstep_summary_has_no_latencies_or_misses() {
        let text = summary(&large("lockstep", 900));
        for word in ["latency", "late us", "missed", "Hz", "real time", "0.000"] {
            assert!(!text.contains(word), "{word}: {text}");
        }
        assert!(summary(&large("realtime", 900)).contains("latency"));
    }
}
