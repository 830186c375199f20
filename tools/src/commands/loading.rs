//! Loading of graph files for commands, with error output.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{PathBufValueParser, TypedValueParser};
use motorium::graph::{self, Checked, Machine, Override};
use motorium::worker::Registry;

use super::examples;
use crate::complete;
use crate::failure::{Failure, Kind};
use crate::out::errln;

/// Graph that runs if none is named.
pub(crate) const DEFAULT_GRAPH: &str = "graphs/panda-reach.toml";
/// Name of standard input.
const STDIN: &str = "-";
/// Example identical to the default graph.
const DEFAULT_EXAMPLE: &str = "panda-reach";

/// Returns the parser for the graph of a command that reads it more than once: standard input is refused.
pub(crate) fn graph_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        let once = "this command starts the graph more than once, but standard input can only be read once: write \
                    the graph to a file";
        if path == Path::new(STDIN) { Err(once) } else { Ok(path) }
    })
}

/// Options that select a graph and override its values.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct GraphArgs {
    /// The graph file, `-` for standard input [default: graphs/panda-reach.toml]
    #[arg(default_value = DEFAULT_GRAPH, hide_default_value = true, add = complete::graphs())]
    pub(crate) graph: PathBuf,
    /// A built-in example graph: draw-letter, panda-reach, quadruped-trot or two-arms
    #[arg(long, value_name = "NAME", conflicts_with = "graph", value_parser = examples::names(),
          hide_possible_values = true)]
    pub(crate) example: Option<String>,
    /// Merge a file over the graph, before `--set`: tables merge, values replace; may be repeated
    #[arg(long = "with", value_name = "OVERLAY.toml", add = complete::graphs())]
    pub(crate) with: Vec<PathBuf>,
    /// Set a value of the graph file, such as `controller.config.damping=1e-4`; may be repeated
    #[arg(long = "set", value_name = "COMPONENT.KEY=VALUE")]
    pub(crate) set: Vec<Override>,
}

impl Default for GraphArgs {
    fn default() -> Self {
        Self { graph: PathBuf::from(DEFAULT_GRAPH), example: None, with: Vec::new(), set: Vec::new() }
    }
}

impl GraphArgs {
    /// Returns the name and text of the example to load instead of a file: the named example, or the default
    /// graph if it is not in the current folder.
    fn embedded(&self) -> Option<(&str, &'static str)> {
        if let Some(name) = &self.example {
            return Some((name, examples::text(name)?));
        }
        let missing = self.graph == Path::new(DEFAULT_GRAPH) && !self.graph.exists();
        missing.then_some(DEFAULT_EXAMPLE).and_then(|name| {
            errln!("{DEFAULT_GRAPH} not found: using the built-in example `{name}`");
            Some((name, examples::text(name)?))
        })
    }

    /// Loads and checks the graph. Warnings and errors go to standard error, and errors as JSON to standard
    /// output. `Err` contains the exit code.
    pub(crate) fn load(&self, registry: &Registry) -> Result<Checked, ExitCode> {
        let checked = self.load_silently(registry)?;
        let colour = std::io::stderr().is_terminal();
        for warning in &checked.warnings {
            errln!("{}\n", warning.render(colour));
        }
        Ok(checked)
    }

    /// Loads and checks the graph like [`load`](Self::load), but does not print warnings. For a command whose
    /// answer contains the warnings.
    pub(crate) fn load_silently(&self, registry: &Registry) -> Result<Checked, ExitCode> {
        let colour = std::io::stderr().is_terminal();
        let machine = Machine::detect();
        let loaded = match self.embedded() {
            Some((name, text)) => {
                let file = PathBuf::from(format!("{name}.toml"));
                graph::check_with(&file, text.to_string(), &self.with, &self.set, registry, &machine)
            }
            None if self.graph == Path::new(STDIN) => {
                match std::io::read_to_string(std::io::stdin().lock()) {
                    // Paths in it are relative to the current folder.
                    Ok(text) => {
                        graph::check_with(Path::new("stdin"), text, &self.with, &self.set, registry, &machine)
                    }
                    Err(error) => {
                        let words = format!("the graph on standard input cannot be read: {error}");
                        return Err(Failure::new(Kind::Invalid, words).report());
                    }
                }
            }
            None => graph::load_with(&self.graph, &self.with, &self.set, registry, &machine),
        };
        match loaded {
            Ok(checked) => Ok(checked),
            Err(error) => {
                errln!("{}", error.render(colour));
                Err(Failure::of_graph(error.reports()).print_json())
            }
        }
    }
}
