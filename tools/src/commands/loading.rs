//! Loading a graph file for a command, with its errors printed.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use motorium::graph::{self, Checked, Machine, Override};
use motorium::worker::Registry;

use crate::exit;
use crate::out::{errln, outln};

/// The graph that runs when none is named.
pub(crate) const DEFAULT_GRAPH: &str = "graphs/panda-reach.toml";

/// Options that name a graph, and override its values.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct GraphArgs {
    /// The graph file; graphs/panda-reach.toml if not given
    #[arg(default_value = DEFAULT_GRAPH, hide_default_value = true)]
    pub(crate) graph: PathBuf,
    /// Lay a file over the graph, before `--set`: tables merge, values replace; may be repeated
    #[arg(long = "with", value_name = "OVERLAY.toml")]
    pub(crate) with: Vec<PathBuf>,
    /// Set a value of the graph file, such as `controller.config.damping=1e-4`; may be repeated
    #[arg(long = "set", value_name = "COMPONENT.KEY=VALUE")]
    pub(crate) set: Vec<Override>,
}

impl Default for GraphArgs {
    fn default() -> Self {
        Self { graph: PathBuf::from(DEFAULT_GRAPH), with: Vec::new(), set: Vec::new() }
    }
}

impl GraphArgs {
    /// Loads and checks the graph. Its errors go to standard error, or as JSON to standard output; `Err` is then the
    /// exit code.
    pub(crate) fn load(&self, registry: &Registry, json: bool) -> Result<Checked, ExitCode> {
        let colour = std::io::stderr().is_terminal();
        match graph::load_with(&self.graph, &self.with, &self.set, registry, &Machine::detect()) {
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
