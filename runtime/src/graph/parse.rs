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
        let mut duplicates = 0;
        for error in &errors {
            let text = &self.sources.file().text;
            let span = error.span().unwrap_or(text.len()..text.len());
            if error.message() != "duplicate key" {
                report
                    .error(format!("the file is not TOML: {}", error.message()))
                    .at(&span, "")
                    .advise("graph files are TOML, see https://toml.io: `key = value`, text in quotes");
                continue;
            }
            duplicates += 1;
            // every key of a table that stands there twice is found again
            if duplicates == 1 {
                report
                    .error(format!(
                        "`{}` stands here for the second time",
                        text.get(span.clone()).unwrap_or_default()
                    ))
                    .at(&span, "already defined above")
                    .advise("put both together, or rename one of them");
            }
        }
        if !errors.is_empty() {
            // the rest was not parsed reliably and would give false errors
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
