//! Runs that end before the viewer has found them. The command that runs the graph ends immediately.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Command;

use serde_json::json;

use crate::VIEW;

/// Returns exit code and standard error of the viewer whose run command is this shell line.
fn viewed(line: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    std::fs::write(&run, format!("#!/bin/sh\n{line}\n")).expect("the folder takes files");
    std::fs::set_permissions(&run, Permissions::from_mode(0o755)).expect("it is ours");
    let order = json!({ "motorium": run, "graph": "a.toml", "port": 0, "rate_hz": 60.0 });
    let output = Command::new(VIEW).args(["motorium-view", &order.to_string()]).output().expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn unseen_successful_run_is_reported_as_a_failure() {
    let (code, errors) = viewed("exit 0");
    assert!(errors.contains("error: the run was over before the viewer saw it"), "{errors}");
    assert_eq!(code, Some(1), "{errors}");
}

#[test]
fn unseen_failure_keeps_its_exit_code_silently() {
    let (code, errors) = viewed("exit 3");
    assert!(!errors.contains("error"), "{errors}");
    assert_eq!(code, Some(3), "{errors}");
}

#[test]
fn unseen_run_ended_by_a_signal_is_a_failure() {
    let (code, errors) = viewed("kill -9 $$");
    assert!(errors.contains("`motorium run` was ended (signal: 9"), "{errors}");
    assert_eq!(code, Some(1), "{errors}");
}
