//! Graph files: the plans of good files, and the messages of errors.

mod declared;
mod files;
mod keys;
mod kinds;
mod limits;
mod mutations;
mod overlays;
mod overrides;
mod programs;
mod schema;
mod units;

use std::path::{Path, PathBuf};

use motorium::graph::{Checked, GraphError, Machine, Override, load_for};

/// Returns a machine with four cores, independent of this machine.
fn machine() -> Machine {
    Machine::with_cores(vec![0, 1, 2, 3])
}

fn load(path: &Path) -> Result<Checked, GraphError> {
    load_for(path, &[], &kinds::registry(), &machine())
}

fn load_with(path: &Path, overrides: &[&str]) -> Result<Checked, GraphError> {
    let overrides: Vec<Override> = overrides.iter().map(|text| text.parse().expect("an override")).collect();
    load_for(path, &overrides, &kinds::registry(), &machine())
}

/// Returns the path of a graph in `good/`.
fn good(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/graph_file/good").join(format!("{name}.toml"))
}

/// Returns the graph files of a folder, relative to the root of the repository.
fn graphs(folder: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let files = std::fs::read_dir(root.join(folder)).expect("a folder of graph files");
    let mut files: Vec<PathBuf> = files.map(|entry| entry.expect("a readable folder").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    assert!(!files.is_empty(), "{folder} holds no graph files");
    files
}

/// Removes the path of the repository from a text.
fn anywhere(text: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    text.replace(&format!("{}/", root.display()), "").replace(&root.display().to_string(), ".")
}

fn stem(path: &Path) -> String {
    path.file_stem().expect("a file").to_string_lossy().into_owned()
}
