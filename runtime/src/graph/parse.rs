//! Parsing of texts to tables.

use toml::de::{DeTable, DeValue};

use super::diagnostic::Report;
use super::merge;
use super::model::GraphTable;
use super::overrides::{self, Override};
use super::read::Value;
use super::source::{Source, Sources};

/// The texts of a graph, ready for parsing: the files, and the overrides padded with blanks.
pub(super) struct Texts<'s> {
    sources: &'s Sources,
    overrides: &'s [Override],
    padded: Vec<String>,
}

impl<'s> Texts<'s> {
    /// Prepares texts for parsing. `sources` contains the files and then one text for each of `overrides`.
    pub(super) fn new(sources: &'s Sources, overrides: &'s [Override]) -> Self {
        let padded = sources
            .overrides()
            .iter()
            .zip(overrides)
            .map(|(source, setting)| source.padded(setting.path.len() + 1))
            .collect();
        Self { sources, overrides, padded }
    }

    /// Returns the merged tables of the graph: the files in order, then the overrides. `None` if a file is
    /// not TOML.
    pub(super) fn parse(&self, report: &mut Report) -> Option<GraphTable<'_>> {
        let files: Vec<_> = self.sources.files().iter().map(|file| parse_file(file, report)).collect();
        let mut graph = DeTable::new();
        for table in files.into_iter().collect::<Option<Vec<_>>>()? {
            merge::lay(&mut graph, table, report);
        }
        for ((setting, source), padded) in
            self.overrides.iter().zip(self.sources.overrides()).zip(&self.padded)
        {
            overrides::apply(&mut graph, setting, source, padded, report);
        }
        GraphTable::read(&Value::new(self.sources.top(), DeValue::Table(graph)), report)
    }
}

/// Returns the tables of one file, with positions in the shared range of offsets.
fn parse_file<'s>(file: &'s Source, report: &mut Report) -> Option<DeTable<'s>> {
    let (table, errors) = DeTable::parse_recoverable(&file.text);
    let mut duplicates = 0;
    for error in &errors {
        let local = error.span().unwrap_or(file.text.len()..file.text.len());
        let span = file.start + local.start..file.start + local.end;
        if error.message() != "duplicate key" {
            report
                .syntax_error(format!("the file is not TOML: {}", error.message()))
                .label(&span, "")
                .advise("graph files are TOML, see https://toml.io: `key = value`, text in quotes");
            continue;
        }
        duplicates += 1;
        // every key of a duplicated table is reported again
        if duplicates == 1 {
            report
                .error(format!("`{}` is defined twice", file.text.get(local).unwrap_or_default()))
                .label(&span, "already defined above")
                .advise("merge both, or rename one of them");
        }
    }
    // after a syntax error the rest is unreliable and would cause false errors
    errors.is_empty().then(|| merge::shifted(table.into_inner(), file.start))
}
