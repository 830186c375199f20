//! The `motorium` program, run as a user runs it.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// The program with these arguments, its output caught.
pub(crate) fn motorium(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_motorium"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs the program to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    motorium(arguments).output().expect("the program starts")
}

/// What the program prints; fails the test if the program fails.
pub(crate) fn printed(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "motorium {}: {}: {errors}", arguments.join(" "), output.status);
    String::from_utf8(output.stdout).expect("text")
}

/// What the program prints, as JSON.
#[allow(dead_code, reason = "not every test reads JSON")]
pub(crate) fn json(arguments: &[&str]) -> serde_json::Value {
    let text = printed(arguments);
    serde_json::from_str(&text)
        .unwrap_or_else(|error| panic!("motorium {}: {error}: {text}", arguments.join(" ")))
}

/// How the program complains; fails the test if it does not.
#[allow(dead_code, reason = "not every test provokes complaints")]
pub(crate) fn complaint(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(!output.status.success(), "motorium {} succeeds", arguments.join(" "));
    assert!(output.stdout.is_empty(), "complaints do not go to standard output");
    String::from_utf8(output.stderr).expect("text")
}

/// The component that `motorium new` writes, built as an example of this crate.
#[allow(dead_code, reason = "not every test runs a component")]
pub(crate) fn component() -> PathBuf {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_motorium"));
    let profile = program.parent().expect("the program lies in its profile's folder");
    let target = profile.parent().expect("which lies in the target folder");
    // `cargo test` builds it as a test only; this takes a moment once, and nothing afterwards.
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "-p", "motorium-tools", "--example", "new_component", "--target-dir"]);
    build.arg(target).current_dir(env!("CARGO_MANIFEST_DIR"));
    if profile.ends_with("release") {
        build.arg("--release");
    }
    assert!(build.status().expect("cargo starts").success(), "the example does not build");
    profile.join("examples/new_component")
}
