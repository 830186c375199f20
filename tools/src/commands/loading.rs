//! Loading a graph file for a command, with its errors printed.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use motorium::graph::{self, Checked, Override};
use motorium::worker::Registry;

use crate::exit;
use crate::out::{errln, outln};

/// The graph that runs when none is named.
pub(crate) const DEFAULT_GRAPH: &str = "graphs/panda-reach.toml";

/// Options that name a graph, and override its values.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct GraphArgs {
    /// The graph file
    #[arg(default_value = DEFAULT_GRAPH)]
    pub(crate) graph: PathBuf,
    /// Set a value of the graph file, such as `controller.config.damping=1e-4`; may be repeated
    #[arg(long = "set", value_name = "COMPONENT.KEY=VALUE")]
    pub(crate) set: Vec<Override>,
}

impl Default for GraphArgs {
    fn default() -> Self {
        Self { graph: PathBuf::from(DEFAULT_GRAPH), set: Vec::new() }
    }
}

impl GraphArgs {
    /// Loads and checks the graph. Its errors go to standard error, or as JSON to standard output; `Err` is then the
    /// exit code.
    pub(crate) fn load(&self, registry: &Registry, json: bool) -> Result<Checked, ExitCode> {
        let colour = std::io::stderr().is_terminal();
        match graph::load(&self.graph, &self.set, registry) {
            Ok(checked) => {
                if !json {
                    for warning in &checked.warnings {
                        errln!("{}\n", warning.render(colour));
                    }
                }
                Ok(checked)
            }
            Err(error) => {
                if json {
                    outln!("{}", serde_json::json!({ "valid": false, "diagnostics": error.reports() }));
                } else {
                    errln!("{}", error.render(colour));
                }
                Err(exit::invalid())
            }
        }
    }
}
