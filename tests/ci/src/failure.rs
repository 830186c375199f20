//! Reasons why a step failed.

use core::fmt;
use std::io;
use std::process::ExitStatus;

/// A step did not run to its end.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A program did not start.
    Start { command: String, source: io::Error },
    /// A program ended with a failure. `message` is the last line that it printed, or empty.
    Ended { command: String, status: ExitStatus, message: String },
    /// A file or folder is not accessible.
    File { path: String, source: io::Error },
    /// A program printed something else than expected.
    Output { command: String, expected: String },
    /// A check failed that does not depend on time.
    Check(String),
    /// A check in real time failed.
    RealTime(String),
}

impl Failure {
    /// Returns a function that adds the path to an error.
    pub(crate) fn file(path: &std::path::Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.display().to_string();
        move |source| Self::File { path, source }
    }

    /// Returns `true` if a host that stops the machine can cause it. `codes` are the exit codes of programs
    /// that it can cause.
    pub(crate) fn depends_on_time(&self, codes: &[i32]) -> bool {
        match self {
            Self::RealTime(_) => true,
            Self::Ended { status, .. } => status.code().is_some_and(|code| codes.contains(&code)),
            Self::Start { .. } | Self::File { .. } | Self::Output { .. } | Self::Check(_) => false,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start { command, source } => write!(f, "`{command}` does not start: {source}"),
            Self::Ended { command, status, message } if message.is_empty() => {
                write!(f, "`{command}` failed: {status}")
            }
            Self::Ended { command, status, message } => {
                write!(f, "`{command}` failed: {status}, last line: {message}")
            }
            Self::File { path, source } => write!(f, "`{path}`: {source}"),
            Self::Output { command, expected } => write!(f, "`{command}` printed no {expected}"),
            Self::Check(text) | Self::RealTime(text) => f.write_str(text),
        }
    }
}
