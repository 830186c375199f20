//! Exclusive use of the machine by real-time tests.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Reserves the whole machine for one test. Real-time components of concurrent tests would otherwise starve
/// one another.
///
/// The function locks the file `real-time.lock` in `folder`. In integration tests, use
/// `env!("CARGO_TARGET_TMPDIR")`, which all test programs of a workspace share. The lock is released when the
/// returned file is dropped or the process ends.
///
/// The function prints the Unix time at which the test acquired the lock, so that failures can be compared
/// with the activity of a virtual machine's host.
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
/// If the file cannot be created or locked.
#[must_use = "the machine is free again as soon as this is dropped"]
pub fn machine(folder: impl AsRef<Path>) -> File {
    let file = File::create(folder.as_ref().join("real-time.lock")).expect("the folder takes files");
    file.lock().expect("the file can be locked");
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    println!("real time from {:.3}", now.as_secs_f64());
    file
}
