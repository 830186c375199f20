//! Graph files: parsing, resolving and checking, with every error reported at its position.
//!
//! [`load`] converts a graph file to a [`Plan`] or returns all of its errors. The stages are:
//!
//! * `layers`, `merge`: merging of files, extended files and overlays;
//! * `source`, `overrides`: source texts, and values overridden by `--set`;
//! * `read`, `values`, `units`, `model`: from TOML to typed tables, key by key;
//! * `resolve`: look-up of names, checks of wires and times, defaults;
//! * `diagnostic`, `render`: errors with positions and advice;
//! * `schema`: the JSON Schema, generated from the same tables.

mod defaults;
mod diagnostic;
mod error;
mod file;
mod json;
mod layers;
mod machine;
mod merge;
mod model;
mod overrides;
mod parse;
pub mod programs;
mod read;
mod render;
mod resolve;
mod schema;
mod source;
mod values;

use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use diagnostic::{Diagnostic, DiagnosticReport, PlaceReport};
pub use error::GraphError;
pub use machine::Machine;
pub use overrides::{Override, OverrideError};
pub use resolve::{DECLARE_BOUND_NS, DeclareTime};
pub use schema::schema;

use crate::plan::Plan;
use crate::worker::Registry;
use diagnostic::Report;
use layers::Layers;
use source::Sources;

/// A checked graph, which can run.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// The resolved graph.
    pub plan: Plan,
    /// Warnings about settings that are valid but probably unintended.
    pub warnings: Vec<Diagnostic>,
    /// Duration of each component's declaration, in file order.
    pub declared: Vec<DeclareTime>,
}

/// Reads a graph file, applies `overrides`, and checks the graph for the current machine. Performs all checks
/// that are possible before the start.
///
/// # Errors
/// Returns all errors found, each with its position and advice.
pub fn load(path: &Path, overrides: &[Override], registry: &Registry) -> Result<Checked, GraphError> {
    load_for(path, overrides, registry, &Machine::detect())
}

/// Loads a graph file like [`load`], but checks it for `machine` in place of the current machine.
///
/// # Errors
/// Returns all errors found, each with its position and advice.
pub fn load_for(
    path: &Path,
    overrides: &[Override],
    registry: &Registry,
    machine: &Machine,
) -> Result<Checked, GraphError> {
    load_with(path, &[], overrides, registry, machine)
}

/// Loads a graph file like [`load_for`], and applies overlay files to it, in order, before the `overrides`.
/// An overlay is a graph file that contains only differences.
///
/// # Errors
/// Returns all errors found, each with its position and advice.
pub fn load_with(
    path: &Path,
    overlays: &[PathBuf],
    overrides: &[Override],
    registry: &Registry,
    machine: &Machine,
) -> Result<Checked, GraphError> {
    check_with(path, read(path)?, overlays, overrides, registry, machine)
}

/// Checks a graph like [`load_with`], with `text` in place of the content of the file at `path`.
///
/// # Errors
/// Returns all errors found, each with its position and advice.
pub fn check_with(
    path: &Path,
    text: String,
    overlays: &[PathBuf],
    overrides: &[Override],
    registry: &Registry,
    machine: &Machine,
) -> Result<Checked, GraphError> {
    let mut layers = Layers::of_graph(path, text);
    for overlay in overlays {
        layers.add(overlay, read(overlay)?);
        let ((files, bytes), (most, longest)) = (layers.size(), Layers::LIMITS);
        if files > most || bytes > longest {
            return Err(too_large(overlay, files, bytes));
        }
    }
    check_layers(path, layers, overrides, registry, machine)
}

/// Checks a graph like [`load_for`], with `text` in place of the content of the file at `path`.
///
/// # Errors
/// Returns all errors found, each with its position and advice.
pub fn check(
    path: &Path,
    text: String,
    overrides: &[Override],
    registry: &Registry,
    machine: &Machine,
) -> Result<Checked, GraphError> {
    check_layers(path, Layers::of_graph(path, text), overrides, registry, machine)
}

fn check_layers(
    path: &Path,
    layers: Layers,
    overrides: &[Override],
    registry: &Registry,
    machine: &Machine,
) -> Result<Checked, GraphError> {
    let (mut sources, problems) = layers.into_sources();
    for setting in overrides {
        sources.add_override(setting.to_string());
    }
    let sources = Arc::new(sources);
    let mut report = Report::new(Arc::clone(&sources));
    problems.report(&mut report);
    if report.has_errors() {
        // without the base file, the files above would cause false errors
        return Err(GraphError::new(report.into_diagnostics()));
    }
    let context = resolve::Context::new(path, &sources, registry, machine);
    let texts = parse::Texts::new(&sources, overrides);
    let plan = texts.parse(&mut report).and_then(|graph| resolve::resolve(&graph, &context, &mut report));
    match plan {
        Some((plan, declared)) => Ok(Checked { plan, warnings: report.into_diagnostics(), declared }),
        None => Err(GraphError::new(report.into_diagnostics())),
    }
}

/// Reads a file named by the user.
fn read(path: &Path) -> Result<String, GraphError> {
    let bytes = file::read(path).map_err(|error| unreadable(path, &error))?;
    String::from_utf8(bytes).map_err(|error| not_text(path, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> GraphError {
    let name = path.display().to_string();
    let mut report = Report::new(Arc::new(Sources::of_file(name.clone(), String::new())));
    let diagnostic = report.error(format!("the graph file `{name}` cannot be read: {error}"));
    match file::near(path) {
        Some(near) => diagnostic.advise(format!("did you mean `{}`?", path.with_file_name(near).display())),
        None => {
            diagnostic.advise("name a graph file; `--example panda-reach` is one that comes with motorium")
        }
    };
    GraphError::new(report.into_diagnostics())
}

fn too_large(path: &Path, files: usize, bytes: usize) -> GraphError {
    let mut report = Report::new(Arc::new(Sources::of_file(path.display().to_string(), String::new())));
    let (most, longest) = Layers::LIMITS;
    report
        .error(format!(
            "the graph has {files} files of {bytes} bytes, expected at most {most} files of {longest} bytes (16 MiB)"
        ))
        .advise("merge some of the overlays");
    GraphError::new(report.into_diagnostics())
}

fn not_text(path: &Path, error: &std::string::FromUtf8Error) -> GraphError {
    let valid = error.utf8_error().valid_up_to();
    let text = String::from_utf8_lossy(&error.as_bytes()[..valid]).into_owned();
    let mut report = Report::new(Arc::new(Sources::of_file(path.display().to_string(), text)));
    report
        .error("the graph file is not UTF-8 text")
        .label(&(valid..valid), "the first byte that is not UTF-8 follows here")
        .advise("save the file as UTF-8");
    GraphError::new(report.into_diagnostics())
}
