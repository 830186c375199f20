//! The failure of a command: text on standard error and, with `--json`, one object on standard output.

mod origin;

use std::process::ExitCode;
use std::sync::OnceLock;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use motorium::graph::DiagnosticReport;
use motorium::severity::Severity;
use schemars::JsonSchema;
use serde::Serialize;

use crate::exit::Code;
use crate::out::{errln, outln};
use crate::style;
use origin::Origin;

/// A failed command: the one JSON object that it prints with `--json`, on one line.
///
/// A command that has an answer although it ends with another exit code than 0 (the report of a run that
/// ended in a safe stop, the findings of the doctor) prints that answer instead, which contains the outcome.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(title = "Error")]
pub(crate) struct Failure {
    /// Always `false`: the command did nothing, or only a part of its work.
    valid: bool,
    /// The error and its causes, in one line.
    error: String,
    /// Class of the failure.
    kind: Kind,
    /// Exit code of the command, one for each `kind` of failure.
    exit_code: u8,
    /// The file at fault; `--set` for an override of the command line.
    file: Option<String>,
    /// Line in that file, counted from 1.
    line: Option<usize>,
    /// Column in that line, counted from 1.
    column: Option<usize>,
    /// The value found.
    found: Option<String>,
    /// The value expected.
    expected: Option<String>,
    /// Advice on how to fix the problem.
    help: Option<String>,
    /// All findings of a graph file; the fields above describe the first.
    diagnostics: Vec<DiagnosticReport>,
}

/// Class of a failure. Each class has a separate exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    /// Something failed (exit code 1): a component that cannot be started, no run to inspect, a file that
    /// cannot be read.
    Failed,
    /// Wrong usage (exit code 2): an unknown command or option, an option that cannot be read.
    Usage,
    /// An input file is invalid or missing (exit code 3). Nothing was started.
    Invalid,
    /// The run ended in a safe stop (exit code 4).
    SafeStop,
}

impl Kind {
    fn code(self) -> u8 {
        match self {
            Self::Failed => Code::Failed as u8,
            Self::Usage => Code::Usage as u8,
            Self::Invalid => Code::Invalid as u8,
            Self::SafeStop => Code::SafeStop as u8,
        }
    }
}

/// `true` if the command line contains `--json`.
static JSON: OnceLock<bool> = OnceLock::new();

/// Determines from the program's arguments whether errors are printed as JSON.
pub(crate) fn arrange(arguments: &[String]) {
    let options = arguments.iter().take_while(|argument| *argument != "--");
    let _ = JSON.set(options.into_iter().any(|argument| argument == "--json"));
}

impl Failure {
    /// Creates a failure of a class, with a message.
    pub(crate) fn new(kind: Kind, error: impl Into<String>) -> Self {
        let error = error.into();
        let (found, expected) = parts(&error);
        let exit_code = kind.code();
        Self {
            valid: false,
            error,
            kind,
            exit_code,
            file: None,
            line: None,
            column: None,
            found,
            expected,
            help: None,
            diagnostics: Vec::new(),
        }
    }

    /// Adds advice.
    pub(crate) fn help(self, help: &str) -> Self {
        Self { help: Some(help.to_string()), ..self }
    }

    /// Returns the failure described by an error and its causes.
    pub(crate) fn from_error(error: &anyhow::Error) -> Self {
        Self::caused(message(error), error.chain())
    }

    /// Returns the failure of a library error, with its own message.
    pub(crate) fn of_error(error: &(dyn std::error::Error + 'static)) -> Self {
        Self::caused(error.to_string(), anyhow::Chain::new(error))
    }

    fn caused(message: String, causes: anyhow::Chain<'_>) -> Self {
        let mut failure = Self::new(Kind::Failed, message);
        for origin in causes.map(Origin::from_error) {
            if origin.invalid {
                (failure.kind, failure.exit_code) = (Kind::Invalid, Kind::Invalid.code());
            }
            failure.file = failure.file.or(origin.file);
            failure.line = failure.line.or(origin.line);
            failure.column = failure.column.or(origin.column);
            failure.found = origin.found.or(failure.found);
            failure.expected = origin.expected.or(failure.expected);
            failure.help = failure.help.or(origin.help);
        }
        failure
    }

    /// Returns the failure of a graph that has errors.
    pub(crate) fn of_graph(diagnostics: Vec<DiagnosticReport>) -> Self {
        let first = diagnostics.iter().find(|finding| finding.severity == Severity::Error);
        let mut failure = Self::new(Kind::Invalid, first.map_or("", |first| &first.message));
        if let Some(first) = first {
            (failure.file, failure.line, failure.column) =
                (Some(first.file.clone()), first.line, first.column);
            let (found, expected) = parts(&first.label);
            failure.found = failure.found.or(found);
            failure.expected = failure.expected.or(expected);
            failure.help = first.advice.clone();
        }
        Self { diagnostics, ..failure }
    }

    /// Returns the failure of an invalid command line.
    fn of_usage(error: &clap::Error) -> Self {
        let words = error.to_string();
        let first = words.lines().next().unwrap_or_default();
        let mut failure = Self::new(Kind::Usage, first.strip_prefix("error: ").unwrap_or(first));
        let text = |kind| {
            error.get(kind).and_then(|value| match value {
                ContextValue::String(text) => Some(text.clone()),
                ContextValue::Strings(texts) if !texts.is_empty() => Some(texts.join(", ")),
                ContextValue::StyledStr(text) => Some(text.to_string()),
                ContextValue::Number(number) => Some(number.to_string()),
                _ => None,
            })
        };
        let found = [ContextKind::InvalidValue, ContextKind::InvalidSubcommand, ContextKind::InvalidArg];
        failure.found = found.into_iter().find_map(text).or(failure.found);
        let expected = [ContextKind::ValidValue, ContextKind::ValidSubcommand];
        failure.expected = expected.into_iter().find_map(text).or(failure.expected);
        let near = [
            ContextKind::SuggestedValue,
            ContextKind::SuggestedSubcommand,
            ContextKind::SuggestedArg,
            ContextKind::SuggestedCommand,
        ];
        let near = near.into_iter().find_map(text).map(|near| format!("did you mean `{near}`?"));
        failure.help = near.or_else(|| text(ContextKind::Usage).map(|usage| usage.replace('\n', " ")));
        failure
    }

    /// Prints the failure and returns the exit code of the command.
    pub(crate) fn report(&self) -> ExitCode {
        errln!("{}: {}", style::error("error"), self.error);
        self.print_json()
    }

    /// Prints the object if the command line has `--json`, for failures whose message is already printed.
    pub(crate) fn print_json(&self) -> ExitCode {
        if JSON.get() == Some(&true)
            && let Ok(object) = serde_json::to_string(self)
        {
            outln!("{object}");
        }
        ExitCode::from(self.exit_code)
    }
}

/// Ends the program like clap does, for an invalid command line or a request for help.
pub(crate) fn usage(error: &clap::Error) -> ExitCode {
    let is_answer = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
    let _ = error.print();
    if is_answer { ExitCode::SUCCESS } else { Failure::of_usage(error).print_json() }
}

/// Returns an error and its causes in one line. A cause whose text is already in the message is not repeated,
/// nor the message if its cause begins with it.
fn message(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |message, cause| {
        let cause = cause.to_string();
        match message.as_str() {
            "" => cause,
            before if before.contains(&cause) => message,
            before if cause.starts_with(&format!("{before}: ")) => cause,
            _ => format!("{message}: {cause}"),
        }
    })
}

/// Returns the values of a message of the form `found A, expected B` or `A is B, expected C`.
fn parts(message: &str) -> (Option<String>, Option<String>) {
    let Some((before, after)) = message.split_once("expected ") else { return (None, None) };
    let ends = |text: &str| {
        let end = text.find([';', '\n']).unwrap_or(text.len());
        text[..end].trim().trim_end_matches([',', ':']).to_string()
    };
    let expected = after.split(", found ").next().map(ends).filter(|text| !text.is_empty());
    let found = match (before.rsplit_once("found "), after.split_once(", found ")) {
        (Some((_, found)), _) | (None, Some((_, found))) => Some(ends(found)),
        (None, None) => before.rsplit_once(" is ").map(|(_, found)| ends(found)),
    };
    (found.filter(|text| !text.is_empty()), expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cause_already_in_the_message_is_not_repeated() {
        let cause = || std::io::Error::from_raw_os_error(28);
        let error =
            anyhow::Error::new(cause()).context(format!("/dev/shm/a: {}", cause())).context("making a run");
        assert_eq!(message(&error), "making a run: /dev/shm/a: No space left on device (os error 28)");
        let error = anyhow::anyhow!("a/b: it is a folder").context("a/b");
        assert_eq!(message(&error), "a/b: it is a folder");
    }

    #[test]
    fn found_and_expected_values_are_read_from_messages() {
        let of = |message: &str| {
            let (found, expected) = parts(message);
            (found.unwrap_or_default(), expected.unwrap_or_default())
        };
        let pair = |found: &str, expected: &str| (found.to_string(), expected.to_string());
        assert_eq!(of("a.csv, line 2: found `x`, expected a number; see there"), pair("`x`", "a number"));
        assert_eq!(of("expected 3 numbers, found 2"), pair("2", "3 numbers"));
        assert_eq!(of("effort is -1, expected a positive number"), pair("-1", "a positive number"));
        assert_eq!(of("there is no run"), pair("", ""));
    }
}
