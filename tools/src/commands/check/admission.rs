//! Response times of a graph, as tables.

use std::fmt::Write as _;

use motorium::plan::ClockKind;
use motorium::schedule::{Admission, Verdict};
use motorium::severity::Severity;
use motorium::units::TimeSpan;

use crate::report::table;
use crate::style;

/// Returns the cores, components and latencies with their bounds, each with the terms of its sum.
///
/// `origin` names the source of the overheads.
pub(crate) fn describe(admission: &Admission, origin: &str) -> String {
    if admission.clock == ClockKind::Lockstep {
        return "in lockstep nothing has a deadline: budgets, priorities and latencies are not analysed\n"
            .to_string();
    }
    if admission.cores.is_empty() && admission.deadlines.is_none() {
        return String::new();
    }
    let mut cores = table(["core", "", "load of real-time components"]);
    for core in &admission.cores {
        cores.add_row([core.core.to_string(), verdict(core.verdict).to_string(), core.arithmetic.clone()]);
    }
    if let Some(load) = &admission.deadlines {
        cores.add_row(["all".to_string(), verdict(load.verdict).to_string(), load.arithmetic.clone()]);
    }
    let mut tasks = table(["component", "core", "priority", "", "longest time from release to end of step"]);
    for task in admission.tasks.iter().filter(|task| task.verdict != Verdict::BestEffort) {
        let number =
            |number: Option<usize>| number.map_or_else(|| "-".to_string(), |number| number.to_string());
        tasks.add_row([
            task.component.clone(),
            number(task.core),
            number(task.priority.map(usize::from)),
            verdict(task.verdict).to_string(),
            task.arithmetic.clone(),
        ]);
    }
    let mut text = format!("\n{}\n\n{}\n", cores.trim_fmt(), tasks.trim_fmt());
    if !admission.latencies.is_empty() {
        let mut latencies = table(["latency", "", "longest time from publication to publication"]);
        for latency in &admission.latencies {
            latencies.add_row([
                format!("{} -> {}", latency.from, latency.to),
                verdict(latency.verdict).to_string(),
                latency.arithmetic.clone(),
            ]);
        }
        let _ = write!(text, "\n{}\n", latencies.trim_fmt());
    }
    let _ = writeln!(text, "\n{}", style::dim(assumptions(admission, origin)));
    text
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::BestEffort => "-",
        Verdict::Holds => "holds",
        Verdict::NotProvable => "not provable",
        Verdict::Exceeds => "exceeds",
    }
}

fn assumptions(admission: &Admission, origin: &str) -> String {
    let time = |ns: u64| TimeSpan { ns };
    let overheads = &admission.overheads;
    format!(
        "included overheads: {} per step, {} per release by the clock, {} per hand-over on a core, {} per hand-over \
         across cores, {} of polling after it, {} per wake-up minus the spin time\n({origin})",
        time(overheads.worker_ns),
        time(overheads.timer_ns),
        time(overheads.hop_same_core_ns),
        time(overheads.hop_cross_core_ns),
        time(overheads.look_ns),
        time(overheads.wake_ns)
    )
}

/// Problems of the admission with their arithmetic and advice.
pub(crate) fn problems(admission: &Admission) -> String {
    let mut text = String::new();
    for problem in &admission.problems {
        let severity = match problem.severity {
            Severity::Error => style::error("error:"),
            Severity::Warning => style::warning("warning:"),
        };
        let _ = writeln!(text, "{severity} {}", style::strong(&problem.message));
        if let Some(arithmetic) = &problem.arithmetic {
            let _ = writeln!(text, "   = {arithmetic}");
        }
        let _ = writeln!(text, "   = help: {}\n", problem.advice);
    }
    text
}
