//! The machine as what tests in real time take in turns.

use std::fs::File;
use std::path::Path;

/// The whole machine, for one test: components in real time of two tests at once would starve each other.
///
/// A lock on the file `real-time.lock` of a folder: for an integration test `env!("CARGO_TARGET_TMPDIR")`, which all test
/// programs of a workspace share. It is free again once the file is dropped, and when its process ends.
///
/// ```
/// use motorium::prelude::*;
/// use motorium::testing::{Graph, Source, machine};
///
/// let folder = tempfile::tempdir().unwrap();
/// let _machine = machine(folder.path()); // in an integration test: machine(env!("CARGO_TARGET_TMPDIR"))
/// let arm = Source::new("arm", "state", |_| Some(JointState::default()));
/// let report = Graph::new("still").set("clock", "realtime").with(arm).run("20 ms").unwrap();
/// assert_eq!(report.components.len(), 1);
/// ```
///
/// # Panics
/// The file cannot be made or locked.
#[must_use = "the machine is free again as soon as this is dropped"]
pub fn machine(folder: impl AsRef<Path>) -> File {
    let file = File::create(folder.as_ref().join("real-time.lock")).expect("the folder takes files");
    file.lock().expect("the file can be locked");
    file
}
