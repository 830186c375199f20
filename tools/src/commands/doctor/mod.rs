//! `motorium doctor`: checks whether this machine is fit for real time.

mod finding;
mod kernel;
mod leftovers;
mod machine;
mod memory;
mod privileges;
mod wakeup;

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use iceoryx2_bb_elementary::package_version::PackageVersion;
use motorium::os::machine::read;
use motorium::units::TimeSpan;
use serde::Serialize;

use crate::out::{errln, out, outln};
use crate::{exit, style};
use finding::{Finding, Verdict};
use leftovers::Leftovers;

/// Check whether this machine is fit for real time, and print what to change.
///
/// Without --clean, nothing is changed. The exit code is 0 if no check failed, otherwise 5.
///
/// Example: motorium doctor --measure 60s
#[derive(Debug, clap::Args)]
pub(crate) struct Doctor {
    /// Duration of the wake-up measurement; "0 s" skips it
    #[arg(long, value_name = "TIME", default_value = "5s", allow_hyphen_values = true)]
    measure: TimeSpan,
    /// Remove objects that ended runs left in shared memory
    #[arg(long)]
    clean: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// All findings as JSON.
#[derive(Debug, Serialize)]
struct Examination {
    /// True if nothing failed.
    fit: bool,
    findings: Vec<Finding>,
    /// `null` when it was left out.
    wakeup: Option<wakeup::Measured>,
    /// Objects removed from shared memory.
    removed: Vec<PathBuf>,
}

impl Doctor {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let time = Duration::from_nanos(self.measure.ns);
        if std::io::stderr().is_terminal() && !time.is_zero() {
            errln!("{}", style::dim(format!("measuring wake-ups for {} ...", self.measure)));
        }
        let examination = examine(time, self.clean);
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&examination)?);
        } else {
            out!("{}", finding::lines(&examination.findings));
            outln!("\n{}", conclusion(&examination.findings));
        }
        Ok(if examination.fit { ExitCode::SUCCESS } else { exit::unfit() })
    }
}

fn examine(time: Duration, clean: bool) -> Examination {
    let mut findings = kernel::check();
    findings.extend(machine::check());
    findings.extend(privileges::check());
    findings.extend(memory::check());
    let mut leftovers = Leftovers::find(Path::new(memory::SHARED));
    let removed = if clean { leftovers.clean() } else { Vec::new() };
    findings.extend(leftovers.findings(&removed));
    findings.push(Finding::pass(
        "iceoryx2",
        format!("{} (all programs of a graph need this version)", PackageVersion::get()),
    ));
    let wakeup = (!time.is_zero()).then(|| wakeup::measure(time)).flatten();
    findings.extend(wakeup.as_ref().map(wakeup::check));
    let fit = findings.iter().all(|finding| finding.verdict != Verdict::Fail);
    Examination { fit, findings, wakeup, removed }
}

fn conclusion(findings: &[Finding]) -> String {
    let count = |verdict| findings.iter().filter(|finding| finding.verdict == verdict).count();
    match (count(Verdict::Fail), count(Verdict::Warn)) {
        (0, 0) => format!("{}: this machine is fit for real time", style::good("fit")),
        (0, warnings) => {
            format!(
                "{}: graphs run in real time; {warnings} of the findings above could be better",
                style::good("fit")
            )
        }
        (failures, warnings) => {
            format!(
                "{}: {failures} of the checks above failed, {warnings} could be better",
                style::error("not fit")
            )
        }
    }
}

/// Measures the lateness of wake-ups of a real-time thread on this machine, ns, for this time.
pub(crate) fn measure_wake_up(time: std::time::Duration) -> Option<motorium::telemetry::Percentiles> {
    Some(wakeup::measure(time)?.lateness_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_failure_makes_a_machine_unfit() {
        let pass = Finding::pass("a", "x");
        let warn = Finding::warn("b", "x", "y");
        let fail = Finding::fail("c", "x", "y");
        assert!(conclusion(std::slice::from_ref(&pass)).contains("is fit for real time"));
        assert!(
            conclusion(&[pass.clone(), warn.clone()]).contains("1 of the findings above could be better")
        );
        let text = anstream::adapter::strip_str(&conclusion(&[pass, warn, fail])).to_string();
        assert_eq!(text, "not fit: 1 of the checks above failed, 1 could be better");
    }

    #[test]
    fn doctor_examines_every_requirement() {
        let examination = examine(Duration::from_millis(20), false);
        let names: Vec<_> = examination.findings.iter().map(|finding| finding.name).collect();
        for expected in [
            "kernel",
            "preemption",
            "timers",
            "clock source",
            "throttling",
            "machine",
            "cores",
            "hyper-threads",
            "governor",
            "idle states",
            "SCHED_FIFO",
            "SCHED_DEADLINE",
            "locked memory",
            "limits",
            "shared memory",
            "swap",
            "huge pages",
            "runs",
            "leftovers",
            "other iceoryx2",
            "iceoryx2",
            "wake-up",
        ] {
            assert!(names.contains(&expected), "no finding on {expected}: {names:?}");
        }
        assert!(examination.removed.is_empty());
    }
}
