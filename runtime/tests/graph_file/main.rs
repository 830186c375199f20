//! The graph file: what a good one becomes, and what each mistake is answered with.

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

/// A machine with four cores, whatever this one has.
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

/// A graph of `good/`.
fn good(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/graph_file/good").join(format!("{name}.toml"))
}

/// The graph files of a folder, given from the root of the repository.
fn graphs(folder: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let files = std::fs::read_dir(root.join(folder)).expect("a folder of graph files");
    let mut files: Vec<PathBuf> = files.map(|entry| entry.expect("a readable folder").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    assert!(!files.is_empty(), "{folder} holds no graph files");
    files
}

/// A text without the place of the repository on this machine.
fn anywhere(text: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    text.replace(&format!("{}/", root.display()), "").replace(&root.display().to_string(), ".")
}

fn stem(path: &Path) -> String {
    path.file_stem().expect("a file").to_string_lossy().into_owned()
}
