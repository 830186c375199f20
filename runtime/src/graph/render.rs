//! Rendering of diagnostics in the style of rustc.

use annotate_snippets::{Annotation, AnnotationKind, Element, Group, Level, Origin, Renderer, Snippet};

use super::diagnostic::{Diagnostic, Label};
use super::source::Source;
use crate::severity::Severity;

impl Diagnostic {
    /// Renders the diagnostic with the affected lines of the file, `file:line:column` and advice.
    pub fn render(&self, colour: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let mut group: Group<'_> = Group::with_title(level.primary_title(self.message.as_str()));
        let snippets = self.snippets();
        if snippets.is_empty() {
            group = group.element(Origin::path(self.sources.file().name.as_str()));
        }
        for (source, annotations) in snippets {
            let snippet = Snippet::source(source.text.as_str()).path(source.name.as_str());
            group = group.element(Element::from(snippet.annotations(annotations)));
        }
        for note in &self.notes {
            group = group.element(Level::NOTE.message(note.as_str()));
        }
        if let Some(advice) = &self.advice {
            group = group.element(Level::HELP.message(advice.as_str()));
        }
        let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
        renderer.render(&[group])
    }

    /// Returns the annotations of each text, starting with the text that contains the main position.
    fn snippets(&self) -> Vec<(&Source, Vec<Annotation<'_>>)> {
        let mut snippets: Vec<(&Source, Vec<Annotation<'_>>)> = Vec::new();
        let primary = self.primary.iter().map(|label| (AnnotationKind::Primary, label));
        let secondary = self.secondary.iter().map(|label| (AnnotationKind::Context, label));
        for (kind, label) in primary.chain(secondary) {
            let source = self.sources.source_of(&label.span);
            let annotation = annotation(kind, label, source);
            match snippets.iter_mut().find(|(known, _)| known.start == source.start) {
                Some((_, annotations)) => annotations.push(annotation),
                None => snippets.push((source, vec![annotation])),
            }
        }
        snippets
    }
}

fn annotation<'a>(kind: AnnotationKind, label: &'a Label, source: &Source) -> Annotation<'a> {
    let annotation = kind.span(source.local(&label.span));
    if label.text.is_empty() { annotation } else { annotation.label(label.text.as_str()) }
}

impl core::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.render(false))
    }
}
