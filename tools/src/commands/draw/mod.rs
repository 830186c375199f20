//! `motorium graph`: draws a graph.

mod measured;

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_pictures::graph;

use super::loading::GraphArgs;
use crate::out::{out, outln};
use crate::output::{refuse_existing, write_file};
use crate::registry;

/// Draw a graph: components, topics, latency budgets.
///
/// Example: motorium graph graphs/panda-reach.toml --format svg --output panda-reach.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Draw {
    #[command(flatten)]
    graph: GraphArgs,
    /// Format of the drawing
    #[arg(long, value_enum, default_value_t = Format::Mermaid)]
    format: Format,
    /// File to write [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    overwrite: bool,
    /// Add measured values: of a running graph (by id or name), or from a report of `motorium run --json`
    /// [default: the newest running graph]
    #[arg(long, value_name = "RUN|REPORT", num_args = 0..=1)]
    measured: Option<Option<String>>,
    /// Print the checked plan as JSON instead
    #[arg(long, conflicts_with_all = ["output", "overwrite", "measured"])]
    json: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Format {
    /// Text that GitHub and many editors draw
    Mermaid,
    /// A picture
    Svg,
    /// Text for Graphviz
    Dot,
}

impl Draw {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        self.output.iter().try_for_each(|output| refuse_existing(output, self.overwrite))?;
        let source = match &self.measured {
            Some(what) => Some(measured::find(what.as_deref())?),
            None => None,
        };
        // A running graph is drawn as it runs, even if the file has changed since.
        let plan = match source.as_ref().and_then(|source| source.plan.clone()) {
            Some(plan) => plan,
            None => match self.graph.load(&registry::registry()) {
                Ok(checked) => checked.plan,
                Err(code) => return Ok(code),
            },
        };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&plan)?);
            return Ok(ExitCode::SUCCESS);
        }
        if let Some(source) = &source {
            anyhow::ensure!(
                source.fits(&plan),
                "the report does not belong to graph `{}`: they have no component name in common; pass the graph \
                 file of the reported run",
                plan.name
            );
        }
        let measured = source.map(|source| source.describe(&plan));
        let text = match self.format {
            Format::Mermaid => graph::mermaid(&plan, measured.as_ref()),
            Format::Dot => graph::dot(&plan, measured.as_ref()),
            Format::Svg => graph::svg(&plan, measured.as_ref()),
        };
        match self.output {
            Some(path) => write_file(&path, text)?,
            None => out!("{text}"),
        }
        Ok(ExitCode::SUCCESS)
    }
}
