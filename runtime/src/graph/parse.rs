//! From texts to tables.

use toml::de::{DeTable, DeValue};

use super::diagnostic::Report;
use super::model::GraphTable;
use super::overrides::{self, Override};
use super::read::Value;
use super::source::Sources;

/// The texts of a graph, ready to be parsed: the file, and the overrides with blanks before them.
pub(super) struct Texts<'s> {
    sources: &'s Sources,
    overrides: &'s [Override],
    padded: Vec<String>,
}

impl<'s> Texts<'s> {
    /// `sources` holds the file and then one text for each of `overrides`.
    pub(super) fn new(sources: &'s Sources, overrides: &'s [Override]) -> Self {
        let padded = sources
            .overrides()
            .iter()
            .zip(overrides)
            .map(|(source, setting)| source.padded(setting.path.len() + 1))
            .collect();
        Self { sources, overrides, padded }
    }

    /// The tables of the graph, overrides in place; `None` if the file is not TOML.
    pub(super) fn parse(&self, report: &mut Report) -> Option<GraphTable<'_>> {
        let (graph, errors) = DeTable::parse_recoverable(&self.sources.file().text);
        for error in &errors {
            let end = self.sources.file().text.len();
            report
                .error(format!("the file is not TOML: {}", error.message()))
                .at(&error.span().unwrap_or(end..end), "");
        }
        if !errors.is_empty() {
            // what the parser made of the rest would only give mistakes that are none
            return None;
        }
        let span = graph.span();
        let mut graph = graph.into_inner();
        for ((setting, source), padded) in
            self.overrides.iter().zip(self.sources.overrides()).zip(&self.padded)
        {
            overrides::apply(&mut graph, setting, source, padded, report);
        }
        GraphTable::read(&Value::new(span, DeValue::Table(graph)), report)
    }
}
