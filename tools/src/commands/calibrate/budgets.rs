//! Budgets from measured steps.

use std::fmt::Write as _;

use motorium::launcher::Report;
use motorium::plan::Plan;
use motorium::telemetry::Percentiles;
use motorium::units::TimeSpan;
use serde::Serialize;

use crate::report::{microseconds, table};

/// Execution time that a budget covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Cover {
    /// 99 % of all steps
    P99,
    /// 99.9 % of all steps
    P999,
    /// The longest step, including disturbances
    Max,
}

/// The steps of a component, and the budget they suggest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Proposal {
    pub(super) name: String,
    /// Wall-clock time from the start to the end of a step, ns.
    pub(super) execution_ns: Percentiles,
    /// Processor time of each step, ns.
    pub(super) cpu_ns: Percentiles,
    /// Budget in the graph, ns.
    pub(super) given_ns: Option<u64>,
    /// Proposed budget, ns.
    pub(super) budget_ns: u64,
    /// Fraction of a core that the proposed budget uses at the rate of the component.
    pub(super) share: f64,
}

/// Parses a margin: a fraction of the value to which it is added.
pub(super) fn parse_margin(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(margin) if (0.0..=100.0).contains(&margin) => Ok(margin),
        Ok(_) => Err("expected a margin of 0 or more, such as 0.5 for 50 % more".to_string()),
        Err(error) => Err(error.to_string()),
    }
}

/// Proposes budgets for all components of a graph that was run.
pub(super) fn propose(plan: &Plan, report: &Report, cover: Cover, margin: f64) -> Vec<Proposal> {
    let proposals = plan.components.iter().zip(&report.components).map(|(component, measured)| {
        let times = measured.execution_ns;
        let covered = match cover {
            Cover::P99 => times.p99,
            Cover::P999 => times.p999,
            Cover::Max => times.max,
        };
        let budget_ns = round_up((covered as f64 * (1.0 + margin)) as u64);
        Proposal {
            name: component.name.clone(),
            execution_ns: times,
            cpu_ns: measured.cpu_ns,
            given_ns: component.budget_ns,
            budget_ns,
            share: budget_ns as f64 / component.period_ns() as f64,
        }
    });
    proposals.collect()
}

/// Rounds up to two significant digits and to whole microseconds.
fn round_up(ns: u64) -> u64 {
    let mut unit = 1_000;
    while ns.div_ceil(unit) >= 100 {
        unit *= 10;
    }
    ns.div_ceil(unit).max(1) * unit
}

/// Returns the proposals as a table, and as lines for the graph file.
pub(super) fn describe(proposals: &[Proposal], report: &Report) -> String {
    let time = |ns: u64| TimeSpan { ns }.to_string();
    let mut rows = table([
        "component",
        "step us p50/p99/p99.9/max",
        "core us p50/p99",
        "budget",
        "proposed",
        "share",
        "late steps: own/others/host",
    ]);
    for (proposal, measured) in proposals.iter().zip(&report.components) {
        let step = &proposal.execution_ns;
        let misses = &measured.misses;
        rows.add_row([
            proposal.name.clone(),
            [step.p50, step.p99, step.p999, step.max].map(microseconds).join(" / "),
            [proposal.cpu_ns.p50, proposal.cpu_ns.p99].map(microseconds).join(" / "),
            proposal.given_ns.map_or_else(|| "-".to_string(), time),
            time(proposal.budget_ns),
            format!("{:.3}", proposal.share),
            format!("{} / {} / {}", misses.long_step, misses.late_wake, misses.stolen),
        ]);
    }
    let mut text = format!("{}\n\nfor the graph file:\n\n", rows.trim_fmt());
    for proposal in proposals {
        let _ = writeln!(text, "[component.{}]\nbudget = \"{}\"\n", proposal.name, time(proposal.budget_ns));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_rounded_up_to_two_digits_and_whole_microseconds() {
        assert_eq!(round_up(0), 1_000);
        assert_eq!(round_up(18_200), 19_000);
        assert_eq!(round_up(99_000), 99_000);
        assert_eq!(round_up(99_001), 100_000);
        assert_eq!(round_up(121_000), 130_000);
        assert_eq!(round_up(1_210_000), 1_300_000);
    }

    #[test]
    fn invalid_margin_is_refused() {
        assert_eq!(parse_margin("0.5"), Ok(0.5));
        assert!(parse_margin("-1").is_err());
        assert!(parse_margin("much").is_err());
        assert!(parse_margin("NaN").is_err());
    }
}
