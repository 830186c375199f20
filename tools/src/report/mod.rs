//! The report of a run as text.

mod results;

use std::fmt::Write as _;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use motorium::launcher::{Exit, Report};
use motorium::plan::ClockKind;
use motorium::telemetry::Percentiles;

use crate::{gate, style};

/// A table without lines, its columns apart by two blanks.
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

/// A duration in microseconds, three digits.
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

fn short_percentiles(p: &Percentiles) -> String {
    [p.p50, p.p99, p.max].map(microseconds).join(" / ")
}

/// A counter and its words for one and for several.
fn counted(count: u64, one: &str, several: &str) -> Option<String> {
    (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { several }))
}

/// What is zero in a run as it should be, of each component where it is not.
fn counters(report: &Report, text: &mut String) {
    for c in &report.components {
        let words = [
            counted(c.misses.skipped, "step skipped", "steps skipped"),
            counted(u64::from(c.restarts), "restart", "restarts"),
            counted(c.allocations.unwrap_or(0), "allocation", "allocations"),
            counted(
                c.allocations_apart.unwrap_or(0),
                "allocation that is known of",
                "allocations that are known of",
            ),
            counted(c.page_faults, "page fault", "page faults"),
            c.allocations.is_none().then(|| "allocations not counted".to_string()),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        if !words.is_empty() {
            let _ = writeln!(text, "{}: {}", c.name, words.join(", "));
        }
    }
}

/// The closing summary of a run.
pub(crate) fn summary(report: &Report) -> String {
    let mut text = String::new();
    let how = match &report.exit {
        Exit::Finished => style::good("finished"),
        Exit::Interrupted => style::warning("interrupted"),
        Exit::SafeStop { .. } => style::error("safe stop"),
    };
    let _ = write!(text, "\n{} {how} after {:.1} s", style::strong(&report.graph), report.duration_s);
    if report.clock == ClockKind::Lockstep {
        let _ = write!(text, " of simulated time, {:.1} times faster than real time", report.realtime_factor);
    }
    if let Some(hash) = &report.state_hash {
        let _ = write!(text, ", state hash {hash}");
    }
    text.push_str("\n\n");
    for episode in &report.episodes {
        let (index, seed, hash) = (episode.index, episode.seed, &episode.state_hash);
        let (steps, time) = (episode.steps, episode.duration_s);
        let _ =
            writeln!(text, " episode {index}: seed {seed}, {time:.3} s, {steps} steps, state hash {hash}");
    }
    if !report.episodes.is_empty() {
        text.push('\n');
    }
    let realtime = report.clock == ClockKind::Realtime;
    let mut components = match realtime {
        true => table(["component", "steps", "Hz", "late us p50/p99/max", "step us p50/p99/max", "missed"]),
        false => table(["component", "steps", "step us p50/p99/max"]),
    };
    for c in &report.components {
        let mut row = vec![c.name.clone(), c.steps.to_string()];
        if realtime {
            row.extend([format!("{:.1}", c.rate_hz), short_percentiles(&c.lateness_ns)]);
        }
        row.push(short_percentiles(&c.execution_ns));
        if realtime {
            row.push(c.misses.missed().to_string());
        }
        components.add_row(row);
    }
    right_from(&mut components, 1);
    let _ = writeln!(text, "{}", components.trim_fmt());
    counters(report, &mut text);
    missed_steps(report, &mut text);
    for c in &report.components {
        if let Some(words) = c.gate.as_ref().and_then(gate::words) {
            let _ = writeln!(text, "{}: {words}", c.name);
        }
    }
    interrupted(report, &mut text);
    for latency in &report.latencies {
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
        let _ = writeln!(text, "{} {}", style::strong(format!("{name}:")), results::lines(result));
    }
    text
}

/// Interrupts on cores whose steps were too long: the kernel books the time of interrupts on the step.
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

/// Names the cause of every missed step: one of the host is not one of ours.
fn missed_steps(report: &Report, text: &mut String) {
    for c in &report.components {
        let misses = &c.misses;
        let causes: Vec<String> = [
            (misses.stolen, "held up by the host"),
            (misses.late_wake, "held up by others on its core"),
            (misses.long_step, "step too long"),
            (misses.late_input, "stale command, safe state applied"),
            (misses.over_budget, "over budget"),
            (c.deferred, "events deferred by `min_interval`"),
            (c.errors, "errors tolerated"),
            (c.refused, "samples refused"),
        ]
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, cause)| format!("{count} {cause}"))
        .collect();
        if !causes.is_empty() {
            let _ = writeln!(text, "{}: {}", c.name, causes.join(", "));
        }
    }
}
