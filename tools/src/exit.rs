//! Exit codes, documented in the book. 2 is clap's, for wrong usage.

use std::process::ExitCode;

/// Something failed.
pub(crate) const FAILED: ExitCode = ExitCode::FAILURE;

/// A graph file, or another file that a person wrote, is not right.
pub(crate) fn invalid() -> ExitCode {
    ExitCode::from(3)
}

/// The run ended in a safe stop.
pub(crate) fn safe_stop() -> ExitCode {
    ExitCode::from(4)
}

/// The machine is not fit for what was asked.
pub(crate) fn unfit() -> ExitCode {
    ExitCode::from(5)
}

/// The run ended in good order, but not as the graph asks.
pub(crate) fn incomplete() -> ExitCode {
    ExitCode::from(7)
}

/// The run ended in good order, but a figure of its report is not as expected.
pub(crate) fn unmet() -> ExitCode {
    ExitCode::from(8)
}

/// Something has become plainly slower than it was.
pub(crate) fn slower() -> ExitCode {
    ExitCode::from(6)
}
