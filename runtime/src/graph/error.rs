//! Errors of a graph that cannot run.

use serde::Serialize;

use super::diagnostic::{Diagnostic, DiagnosticReport};

/// All errors found in a graph; there is at least one.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct GraphError {
    diagnostics: Vec<Diagnostic>,
}

impl GraphError {
    pub(super) fn new(diagnostics: Vec<Diagnostic>) -> Self {
        Self { diagnostics }
    }

    /// Returns the errors in file order. If there are too many, the last entry gives the number of omitted
    /// errors.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// Returns the errors as data.
    pub fn reports(&self) -> Vec<DiagnosticReport> {
        self.diagnostics.iter().map(Diagnostic::report).collect()
    }

    /// Renders all errors with the affected lines of the file, followed by their number. `colour` enables
    /// terminal colours.
    pub fn render(&self, colour: bool) -> String {
        let mut text = String::new();
        for diagnostic in &self.diagnostics {
            text.push_str(diagnostic.render(colour).trim_end());
            text.push_str("\n\n");
        }
        text.push_str(&self.summary());
        text.push('\n');
        text
    }

    fn summary(&self) -> String {
        let errors: usize = self.diagnostics.iter().map(|diagnostic| diagnostic.count).sum();
        let file = self.diagnostics.first().map_or("", |diagnostic| diagnostic.sources.file().name.as_str());
        match errors {
            1 => format!("1 error in {file}"),
            errors => format!("{errors} errors in {file}"),
        }
    }
}

impl core::fmt::Display for GraphError {
    /// Formats the first error and the number of errors; [`GraphError::render`] shows all.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.diagnostics.first() {
            Some(first) => write!(f, "{}: {}", self.summary(), first.message()),
            None => f.write_str(&self.summary()),
        }
    }
}

impl core::error::Error for GraphError {}
