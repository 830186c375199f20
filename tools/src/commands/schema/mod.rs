//! `motorium schema`: JSON Schemas of the files that motorium reads and writes, and types for Python.

mod python;

use std::process::ExitCode;

use motorium::launcher::Report;
use motorium_benches::latency::Written as Bench;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;

use super::top::Data as Top;
use crate::failure::Failure;
use crate::out::outln;
use crate::registry;

/// Print the JSON Schema of graph files, reports, the output of `top`, benchmarks or errors, or the types for
/// Python.
///
/// Example: motorium schema graph > graph.schema.json
#[derive(Debug, clap::Args)]
pub(crate) struct Schema {
    /// The document that the schema describes
    #[arg(value_enum, default_value_t = Document::Graph)]
    document: Document,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Document {
    /// Graph files, with the `config` table of every built-in kind
    Graph,
    /// The report, as `motorium run --json` prints it
    Report,
    /// The data that `motorium top --json` prints
    Top,
    /// The measurements, as `motorium bench latency --json` prints them
    Bench,
    /// The object that a command that fails prints with `--json`
    Error,
    /// The built-in states as a Python module, for programs that a bridge serves
    Python,
}

impl Schema {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let schema = match self.document {
            Document::Graph => motorium::graph::schema(&registry::registry()),
            Document::Report => written::<Report>(),
            Document::Top => written::<Top>(),
            Document::Bench => written::<Bench>(),
            Document::Error => written::<Failure>(),
            Document::Python => {
                outln!("{}", python::module()?.trim_end());
                return Ok(ExitCode::SUCCESS);
            }
        };
        outln!("{}", serde_json::to_string_pretty(&schema)?);
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the schema of a serialised document: fields that are always present are required.
fn written<T: JsonSchema>() -> schemars::Schema {
    SchemaSettings::draft07().for_serialize().into_generator().into_root_schema_for::<T>()
}
