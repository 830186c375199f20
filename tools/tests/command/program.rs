//! The `motorium` program, run as a user runs it. The tests of whole graphs (`tests/graphs`) share this file.

#![allow(dead_code, reason = "each of the two test programs uses its part of this file")]

use std::fs::File;
use std::process::{Command, Output, Stdio};

use crate::MOTORIUM;

/// Exclusive use of the machine by one real-time test.
#[must_use = "the machine is free again as soon as this is dropped"]
pub(crate) fn machine() -> File {
    motorium::testing::machine(env!("CARGO_TARGET_TMPDIR"))
}

/// The program with these arguments, its output caught.
pub(crate) fn motorium(arguments: &[&str]) -> Command {
    let mut command = Command::new(MOTORIUM);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs the program to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    motorium(arguments).output().expect("the program starts")
}

/// Standard output of the program; fails the test if the program fails.
pub(crate) fn printed(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "motorium {}: {}: {errors}", arguments.join(" "), output.status);
    String::from_utf8(output.stdout).expect("text")
}

/// Standard output of the program as JSON; fails the test if the program fails.
pub(crate) fn json(arguments: &[&str]) -> serde_json::Value {
    let text = printed(arguments);
    serde_json::from_str(&text)
        .unwrap_or_else(|error| panic!("motorium {}: {error}: {text}", arguments.join(" ")))
}

/// Standard error of a program that fails; fails the test if it succeeds or prints to standard output.
pub(crate) fn complaint(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(!output.status.success(), "motorium {} succeeds", arguments.join(" "));
    assert!(output.stdout.is_empty(), "errors are not printed to standard output");
    String::from_utf8(output.stderr).expect("text")
}

/// The completions offered to a shell for the last word.
pub(crate) fn completed(words: &[&str]) -> Vec<String> {
    let mut command = motorium(&[&["--", "motorium"], words].concat());
    let output = command.env("COMPLETE", "fish").output().expect("the program starts");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().filter_map(|line| line.split('\t').next()).map(str::to_string).collect()
}
