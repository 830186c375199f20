//! A finding of the doctor: verdict and remedy.

use std::fmt::Write as _;

use serde::Serialize;

use crate::style;

/// Verdict of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// No problem.
    Pass,
    /// Graphs run, but with degraded timing.
    Warn,
    /// Real-time requirements cannot be met, or graphs cannot run.
    Fail,
}

/// A finding of the doctor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Finding {
    pub(super) name: &'static str,
    pub(super) verdict: Verdict,
    /// What was found, and its consequence.
    pub(super) found: String,
    /// Remedy, as a command if there is one.
    pub(super) fix: Option<String>,
}

impl Finding {
    pub(super) fn pass(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, verdict: Verdict::Pass, found: found.into(), fix: None }
    }

    pub(super) fn warn(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, verdict: Verdict::Warn, found: found.into(), fix: Some(fix.into()) }
    }

    pub(super) fn fail(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, verdict: Verdict::Fail, found: found.into(), fix: Some(fix.into()) }
    }
}

/// Findings as lines: verdict, name, finding; the fix below.
pub(super) fn lines(findings: &[Finding]) -> String {
    let width = findings.iter().map(|finding| finding.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for finding in findings {
        let verdict = match finding.verdict {
            Verdict::Pass => style::good("PASS"),
            Verdict::Warn => style::warning("WARN"),
            Verdict::Fail => style::error("FAIL"),
        };
        let _ = writeln!(text, "{verdict}  {:width$}  {}", finding.name, finding.found);
        for line in finding.fix.iter().flat_map(|fix| fix.lines()) {
            let _ = writeln!(text, "      {:width$}  {}", "", style::dim(format!("fix: {line}")));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_a_column_with_the_fix_below() {
        let findings =
            [Finding::pass("swap", "none"), Finding::warn("clock source", "hpet", "boot with tsc=reliable")];
        let text = anstream::adapter::strip_str(&lines(&findings)).to_string();
        assert_eq!(
            text,
            "PASS  swap          none\nWARN  clock source  hpet\n                    fix: boot with tsc=reliable\n"
        );
    }
}
