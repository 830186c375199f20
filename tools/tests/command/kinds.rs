//! `motorium kinds`: the descriptions of kinds agree with their use in graphs.

use crate::program::{complaint, json, printed, run};
use serde_json::Value;

/// Every built-in kind, described.
fn sheets() -> Vec<Value> {
    let listed = json(&["kinds", "--json"]);
    let listed = listed.as_array().expect("a list");
    assert!(listed.len() >= 12, "{listed:?}");
    listed.iter().map(|line| json(&["kinds", line["kind"].as_str().expect("a name"), "--json"])).collect()
}

/// Returns `true` if a kind needs a library that is missing on this machine, and reports how to install it.
fn lacks_its_library(sheet: &Value) -> bool {
    let lacks = sheet["refused"].as_str().is_some_and(|why| why.contains("`pip install mujoco==3.17.0`"));
    lacks && sheet["kind"] == "physics.mujoco"
}

/// Kinds whose configuration names a user's file, and the file in their error.
const NEEDS_A_FILE: [(&str, &str); 3] = [
    ("learner.task", "balance.toml: No such file"),
    ("policy.latent", "arms.latent: No such file"),
    ("policy.network", "policies/quadruped-trot/policy.toml"),
];

/// Returns `true` if a kind refuses its example because a user's file is missing.
fn needs_a_file(sheet: &Value) -> bool {
    let refused = sheet["refused"].as_str().unwrap_or_default();
    NEEDS_A_FILE.iter().any(|(kind, file)| sheet["kind"] == *kind && refused.contains(file))
}

fn text<'v>(value: &'v Value, key: &str) -> &'v str {
    value[key].as_str().unwrap_or_else(|| panic!("`{key}` of {value}"))
}

#[test]
fn every_kind_declares_its_example_and_has_a_page() {
    for sheet in sheets() {
        let kind = text(&sheet, "kind");
        let refused = !sheet["refused"].is_null() && !lacks_its_library(&sheet) && !needs_a_file(&sheet);
        assert!(!refused, "{kind} refuses its own example: {}", sheet["refused"]);
        assert!(!sheet["config"].as_array().expect("keys").is_empty(), "{kind} has a configuration");
        for key in sheet["config"].as_array().expect("keys") {
            assert!(!text(key, "type").is_empty(), "{kind}: {key}");
        }
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/").to_string() + text(&sheet, "page");
        assert!(std::fs::exists(&page).expect("readable"), "{kind}: no page {page}");
    }
}

#[test]
fn every_example_fits_into_a_graph_with_other_writers() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("graph.toml");
    for sheet in sheets().iter().filter(|sheet| !lacks_its_library(sheet) && !needs_a_file(sheet)) {
        let graph = format!("name = \"example\"\n\n{}", text(sheet, "example"));
        std::fs::write(&file, &graph).expect("written");
        let output = run(&["check", file.to_str().expect("a path of text"), "--json"]);
        let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        for found in answer["diagnostics"].as_array().into_iter().flatten() {
            let message = text(found, "message");
            let unwritten =
                message.contains("which no component publishes") || message.contains("has no writer");
            assert!(unwritten || found["severity"] == "warning", "{message}\n{graph}");
        }
    }
}

#[test]
fn kind_description_fits_80_columns() {
    let sheet = printed(&["kinds", "control.qp"]);
    for expected in [
        "page of the book: kinds/control-qp.md",
        "joint_state  input, required, motorium.JointState",
        "limits.position.margin",
        "1/(rad/s)^2",
        "Default 1e-7",
        "tasks[].cartesian.gain",
        "[component.qp]\nkind      = \"control.qp\"\nrobot     = \"panda\"",
        "[component.qp.config]\n",
    ] {
        assert!(sheet.contains(expected), "{expected}:\n{sheet}");
    }
    let before_example = sheet.split("\nexample\n").next().expect("text");
    for line in before_example.lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
    assert!(printed(&["kinds"]).lines().all(|line| line.chars().count() <= 80));
}

#[test]
fn kind_is_described_for_the_named_robot() {
    let sheet = json(&["kinds", "physics.articulated", "--robot", "quadruped", "--json"]);
    assert_eq!(sheet["robot"], "quadruped");
    // the example names a link of the Panda
    let sheet = json(&["kinds", "control.qp", "--robot", "ur5e", "--json"]);
    assert!(sheet["refused"].is_null() && !sheet["ports"].as_array().expect("ports").is_empty(), "{sheet}");
    assert!(!text(&sheet, "example").contains("panda"), "{sheet}");
    let refused = json(&["kinds", "physics.articulated", "--robot", "quadrupet", "--json"]);
    assert!(text(&refused, "refused").contains("did you mean \"quadruped\""), "{refused}");
}

#[test]
fn unknown_kind_is_answered_with_the_nearest() {
    assert!(complaint(&["kinds", "control.pq"]).contains("did you mean `control.qp`?"));
    let missing = complaint(&["kinds", "--exec", "no/such/program"]);
    assert!(missing.contains("does not exist") && missing.contains("cargo build --release"), "{missing}");
    assert!(!missing.contains("graph file"), "{missing}");
}
