//! Result of a step that ran to its end.

use core::fmt;

/// Tests that did not run, for one reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Skipped {
    /// Their names.
    pub(crate) what: Vec<String>,
    pub(crate) reason: String,
}

impl fmt::Display for Skipped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, reason } = self;
        let tests = if what.len() == 1 { "test" } else { "tests" };
        write!(f, "{} {tests} not run: {reason} ({})", what.len(), what.join(", "))
    }
}

/// Result of a step that ran to its end. It has passed if `failures` and `inconclusive` are empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// Failed checks.
    pub(crate) failures: Vec<String>,
    /// Failed real-time checks, during which the host kept the machine from running. They have not passed.
    pub(crate) inconclusive: Vec<String>,
    pub(crate) skipped: Vec<Skipped>,
    /// Number of real-time checks, whatever their result.
    pub(crate) real_time: usize,
    /// Observations for the closing lines.
    pub(crate) notes: Vec<String>,
}

impl Outcome {
    /// A passed outcome with a note.
    pub(crate) fn noted(note: String) -> Self {
        Self { notes: vec![note], ..Self::default() }
    }
}
