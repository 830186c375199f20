//! `motorium graph`: draws a graph.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;

use super::loading::GraphArgs;
use crate::{draw, registry};

/// Draw a graph: components, topics, latency budgets.
///
/// Example: motorium graph graphs/panda-reach.toml --format svg --output panda-reach.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Draw {
    #[command(flatten)]
    graph: GraphArgs,
    /// What to draw it as
    #[arg(long, value_enum, default_value_t = Format::Mermaid)]
    format: Format,
    /// Where to write it; standard output if not given
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// Print the checked plan as JSON instead
    #[arg(long, conflicts_with = "output")]
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
        let checked = match self.graph.load(&registry::registry(), self.json) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        if self.json {
            println!("{}", serde_json::to_string_pretty(&checked.plan)?);
            return Ok(ExitCode::SUCCESS);
        }
        let text = match self.format {
            Format::Mermaid => draw::mermaid(&checked.plan),
            Format::Dot => draw::dot(&checked.plan),
            Format::Svg => draw::svg(&checked.plan, None),
        };
        match self.output {
            Some(path) => {
                std::fs::write(&path, text).with_context(|| format!("writing {}", path.display()))?
            }
            None => print!("{text}"),
        }
        Ok(ExitCode::SUCCESS)
    }
}
