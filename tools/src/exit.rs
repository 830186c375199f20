//! Exit codes: one table, which the book prints.

use std::process::ExitCode;

use motorium::launcher::{Exit, Report};

macro_rules! codes {
    ($($(#[doc = $doc:literal])+ $name:ident = $code:literal, $meaning:literal;)*) => {
        /// An exit code of the command.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(crate) enum Code {
            $($(#[doc = $doc])+ $name = $code,)*
        }

        impl Code {
            /// All exit codes with their meaning, as in the book.
            #[cfg(test)]
            const ALL: &[(Self, &str)] = &[$((Self::$name, $meaning)),*];
        }
    };
}

codes! {
    /// Success.
    Done = 0, "the run finished or was interrupted, as the graph requires; the command succeeded";
    /// The command failed, for example because a component could not be started.
    Failed = 1, "failure: a component could not be started, no run was found, a value was refused, a file cannot be read or would be overwritten, no actuator confirmed `motorium stop --now`";
    /// Usage error, such as an unknown option. clap uses the same number.
    Usage = 2, "usage error: an unknown command or option, an invalid value of an option; a component program started by hand";
    /// An input file, such as a graph file, is invalid or missing.
    Invalid = 3, "an input file is invalid or missing: a graph, a robot, a benchmark (`bench compare`). Nothing was started";
    /// The run ended in a safe stop.
    SafeStop = 4, "the run ended in a safe stop";
    /// The machine is not suitable.
    Unfit = 5, "`motorium doctor`: the machine is not suitable";
    /// A benchmark found a significant slowdown.
    Slower = 6, "`motorium bench latency --ratchet`, `motorium bench compare`: a significant slowdown";
    /// The run ended normally, but its report contains warnings.
    Incomplete = 7, "the run ended in good order, but not as the graph requires: `warnings` of the report name each shortfall ([below](#shortfalls)); `motorium recover`: messages are damaged or missing";
    /// The run ended normally, but a figure in its report violates an expectation of the graph.
    Unmet = 8, "the run ended in good order, but a figure of its report is not as [expected](graph-file.md#expect)";
}

impl From<Code> for ExitCode {
    fn from(code: Code) -> Self {
        Self::from(code as u8)
    }
}

impl Code {
    /// Returns the exit code of a finished run.
    pub(crate) fn of_run(report: &Report) -> Self {
        match &report.exit {
            Exit::SafeStop { .. } => Self::SafeStop,
            Exit::Finished if report.expectations.iter().any(|expectation| !expectation.met) => Self::Unmet,
            Exit::Finished | Exit::Interrupted if report.warnings.is_empty() => Self::Done,
            Exit::Finished | Exit::Interrupted => Self::Incomplete,
        }
    }
}

/// Something failed.
pub(crate) const FAILED: ExitCode = ExitCode::FAILURE;

/// Returns the exit code for an invalid graph file or other input file.
pub(crate) fn invalid() -> ExitCode {
    Code::Invalid.into()
}

/// Returns the exit code for a run that ended in a safe stop.
pub(crate) fn safe_stop() -> ExitCode {
    Code::SafeStop.into()
}

/// Returns the exit code for an unsuitable machine.
pub(crate) fn unfit() -> ExitCode {
    Code::Unfit.into()
}

/// Returns the exit code for a recovered recording with damaged or missing messages.
pub(crate) fn incomplete() -> ExitCode {
    Code::Incomplete.into()
}

/// Returns the exit code for a significant slowdown.
pub(crate) fn slower() -> ExitCode {
    Code::Slower.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_book_has_the_table_of_exit_codes() {
        let book = include_str!("../../docs/src/safety.md");
        let section = book.split_once("## Exit codes").expect("a section").1;
        let rows: Vec<&str> = section.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
        let codes = Code::ALL.iter().map(|(code, meaning)| format!("| {} | {meaning} |", *code as u8));
        assert_eq!(rows[..Code::ALL.len()], codes.collect::<Vec<_>>());
    }

    #[test]
    fn a_run_has_the_code_of_its_end() {
        let mut report: Report = serde_json::from_str(include_str!("report/large.json")).expect("a report");
        assert_eq!(Code::of_run(&report), Code::Done);
        report.warnings.push("`physics` was in its safe state for 75 % of the run".to_string());
        assert_eq!(Code::of_run(&report), Code::Incomplete);
        report.exit = Exit::Interrupted;
        assert_eq!(Code::of_run(&report), Code::Incomplete);
        report.exit = Exit::SafeStop { reason: "a component died".to_string() };
        assert_eq!(Code::of_run(&report), Code::SafeStop);
    }
}
