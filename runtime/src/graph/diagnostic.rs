//! Findings of a check: message, position, advice.

use std::sync::Arc;

use serde::Serialize;

use super::source::{Sources, Span};
use crate::severity::Severity;

/// A position in a file of the graph or in a `--set` override, with its label.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Label {
    pub span: Span,
    pub text: String,
}

/// Maximum number of findings of one severity that are shown; others appear once these are fixed.
const SHOWN: usize = 20;
/// Maximum number of findings that are shown for a file that does not parse. In a file of another format
/// every line is an error.
const SHOWN_OF_SYNTAX: usize = 5;

/// One error or warning about a graph, with its position and advice.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// Number of findings that this one stands for: 1, except in the summary of hidden findings.
    pub(super) count: usize,
    pub(super) severity: Severity,
    pub(super) message: String,
    pub(super) primary: Option<Label>,
    pub(super) secondary: Vec<Label>,
    pub(super) notes: Vec<String>,
    pub(super) advice: Option<String>,
    pub(super) sources: Arc<Sources>,
}

/// A position in a file, as data for `--json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct PlaceReport {
    /// Path of the file, or `--set` for an override of the command line.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Label of the position; may be empty.
    pub label: String,
}

/// An error or warning as data, for `--json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct DiagnosticReport {
    /// Severity of the finding.
    pub severity: Severity,
    /// Message with the value found and the values expected.
    pub message: String,
    /// Path of the file, or `--set` for an override of the command line.
    pub file: String,
    /// Line, counted from 1; absent if the finding concerns the file as a whole.
    pub line: Option<usize>,
    /// Column in characters, counted from 1; absent if the finding concerns the file as a whole.
    pub column: Option<usize>,
    /// Label of the position; may be empty.
    pub label: String,
    /// Related positions.
    pub related: Vec<PlaceReport>,
    /// Additional facts.
    pub notes: Vec<String>,
    /// Advice, in one sentence.
    pub advice: Option<String>,
}

impl Diagnostic {
    /// Returns the severity of the finding.
    pub fn severity(&self) -> Severity {
        self.severity
    }

    /// Returns the message with the found value and the expected values, in one line.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns the advice in one sentence, or `None`.
    pub fn advice(&self) -> Option<&str> {
        self.advice.as_deref()
    }

    /// Returns the whole finding as data.
    pub fn report(&self) -> DiagnosticReport {
        let place = |label: &Label| {
            let source = self.sources.source_of(&label.span);
            let (line, column) = source.position(&label.span);
            PlaceReport { file: source.name.clone(), line, column, label: label.text.clone() }
        };
        let primary = self.primary.as_ref().map(place);
        DiagnosticReport {
            severity: self.severity,
            message: self.message.clone(),
            file: primary.as_ref().map_or_else(|| self.sources.file().name.clone(), |p| p.file.clone()),
            line: primary.as_ref().map(|p| p.line),
            column: primary.as_ref().map(|p| p.column),
            label: primary.map(|p| p.label).unwrap_or_default(),
            related: self.secondary.iter().map(place).collect(),
            notes: self.notes.clone(),
            advice: self.advice.clone(),
        }
    }

    /// Sets the main position.
    pub(super) fn label(&mut self, span: &Span, label: impl Into<String>) -> &mut Self {
        self.primary = Some(Label { span: span.clone(), text: shortened(label.into()) });
        self
    }

    /// Adds a related position.
    pub(super) fn and(&mut self, span: &Span, label: impl Into<String>) -> &mut Self {
        self.secondary.push(Label { span: span.clone(), text: shortened(label.into()) });
        self
    }

    /// Adds a further fact.
    pub(super) fn note(&mut self, note: impl Into<String>) -> &mut Self {
        self.notes.push(shortened(note.into()));
        self
    }

    /// Sets the advice, in one sentence.
    pub(super) fn advise(&mut self, advice: impl Into<String>) -> &mut Self {
        self.advice = Some(shortened(advice.into()));
        self
    }
}

impl Serialize for Diagnostic {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.report().serialize(serializer)
    }
}

/// Findings collected while a graph is read and resolved.
#[derive(Debug)]
pub(super) struct Report {
    sources: Arc<Sources>,
    diagnostics: Vec<Diagnostic>,
    shown: usize,
}

impl Report {
    pub(super) fn new(sources: Arc<Sources>) -> Self {
        Self { sources, diagnostics: Vec::new(), shown: SHOWN }
    }

    /// Adds an error of syntax.
    pub(super) fn syntax_error(&mut self, message: impl Into<String>) -> &mut Diagnostic {
        self.shown = SHOWN_OF_SYNTAX;
        self.error(message)
    }

    /// Adds an error and returns it for completion.
    pub(super) fn error(&mut self, message: impl Into<String>) -> &mut Diagnostic {
        self.add(Severity::Error, message.into())
    }

    /// Adds a warning and returns it for completion.
    pub(super) fn warning(&mut self, message: impl Into<String>) -> &mut Diagnostic {
        self.add(Severity::Warning, message.into())
    }

    fn add(&mut self, severity: Severity, message: String) -> &mut Diagnostic {
        self.diagnostics.push(Diagnostic {
            count: 1,
            severity,
            message: shortened(message),
            primary: None,
            secondary: Vec::new(),
            notes: Vec::new(),
            advice: None,
            sources: Arc::clone(&self.sources),
        });
        let last = self.diagnostics.len() - 1;
        &mut self.diagnostics[last]
    }

    /// Returns `true` if there is an error, in which case the graph cannot run.
    pub(super) fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
    }

    /// Returns all findings in file order; findings without a position come first. If there are errors,
    /// warnings are omitted, because one error can cause many. Excess findings are replaced by a summary with
    /// their number.
    pub(super) fn into_diagnostics(mut self) -> Vec<Diagnostic> {
        let severity = if self.has_errors() { Severity::Error } else { Severity::Warning };
        self.diagnostics.retain(|diagnostic| diagnostic.severity == severity);
        self.diagnostics.sort_by_key(|diagnostic| diagnostic.primary.as_ref().map(|label| label.span.start));
        self.diagnostics.dedup();
        if let Some(others) = self.diagnostics.len().checked_sub(self.shown).filter(|others| *others > 1) {
            self.diagnostics.truncate(self.shown);
            let what = if severity == Severity::Error { "errors" } else { "warnings" };
            let last = self.add(severity, format!("and {} more {what}", grouped(others)));
            last.advise("fix the first errors; later errors are often their consequences");
            last.count = others;
        }
        self.diagnostics
    }
}

/// Removes the middle of an excessively long text, such as one with a very long name.
fn shortened(text: String) -> String {
    const LONGEST: usize = 1_000;
    if text.len() <= LONGEST {
        return text;
    }
    let (start, end) =
        (text.floor_char_boundary(LONGEST / 2), text.ceil_char_boundary(text.len() - LONGEST / 4));
    format!("{} [... {} bytes ...] {}", &text[..start], grouped(end - start), &text[end..])
}

/// Formats a number with a comma between groups of three digits.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let group = |(i, digit): (usize, char)| {
        let comma = (i > 0 && (digits.len() - i).is_multiple_of(3)).then_some(',');
        comma.into_iter().chain([digit])
    };
    digits.chars().enumerate().flat_map(group).collect()
}

#[cfg(test)]
mod tests {
    use super::{grouped, shortened};

    #[test]
    fn very_long_text_is_shortened_in_the_middle() {
        let short = "name ".repeat(200);
        assert_eq!(shortened(short.clone()), short);
        let long = shortened("µ".repeat(1_000_000));
        assert!(long.len() < 1_000 && long.contains("[... 1,999,250 bytes ...]"), "{long}");
    }

    #[test]
    fn digits_are_grouped_by_commas() {
        for (number, text) in [(2, "2"), (999, "999"), (5_007, "5,007"), (12_345_678, "12,345,678")] {
            assert_eq!(grouped(number), text);
        }
    }
}
