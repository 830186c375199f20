//! `motorium check`: the times of a graph.

use crate::program::{json, machine, motorium, printed, run};
use serde_json::Value;

const OVERLOADED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/broken/overloaded.toml");
const REACH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/panda-reach.toml");

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("text")
}

#[test]
fn infeasible_graph_is_refused_with_the_arithmetic() {
    let output = run(&["check", OVERLOADED]);
    assert_eq!(output.status.code(), Some(3));
    let errors = text(&output.stderr);
    let sum = "0.100 (physics spinning) + 0.496 (physics) + 0.074 (encoder) + 0.074 (policy) + 0.624 (controller) = 1.368 > ";
    assert!(errors.contains(sum), "{errors}");
    assert!(errors.contains("is overloaded"), "{errors}");
    assert!(errors.ends_with("overloaded.toml cannot meet its deadlines\n"), "{errors}");
    assert!(!text(&output.stdout).contains("can run"));
}

#[test]
fn json_refusal_contains_the_whole_admission() {
    let output = run(&["check", OVERLOADED, "--json"]);
    assert_eq!(output.status.code(), Some(3));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(answer["valid"], false);
    let admission = &answer["admission"];
    assert_eq!(admission["verdict"], "exceeds");
    assert_eq!(admission["problems"][0]["severity"], "error");
    assert_eq!(admission["tasks"].as_array().map(Vec::len), Some(4));
    assert!(admission["cores"][0]["share"].as_f64().is_some_and(|share| share > 1.2));
    assert!(answer["plan"]["components"].is_array());
    assert!(answer.get("timeline").is_none(), "the timeline is only included on request");
}

#[test]
fn same_graph_is_valid_in_lockstep() {
    let answer = printed(&["check", OVERLOADED, "--set", "clock=lockstep"]);
    assert!(answer.contains("in lockstep nothing has a deadline"), "{answer}");
}

#[test]
fn reaching_arm_is_feasible_and_drawn() {
    let answer = printed(&["check", REACH]);
    for expected in
        ["longest time from release to end of step", "= 472 us <= 600 us", "left to others", "is valid"]
    {
        assert!(answer.contains(expected), "{expected}: {answer}");
    }
}

#[test]
fn staleness_of_one_actuator_is_printed() {
    let safety = |value: &str| format!("component.physics.safety.stale_after=\"{value}\"");
    let answer = printed(&["check", REACH, "--set", &safety("30 ms")]);
    assert!(answer.contains(": 30 ms until a command is stale, 1 ms period"), "{answer}");
    let output = run(&["check", REACH, "--set", &safety("500 us")]);
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{errors}");
    assert!(
        errors.contains("commands of `physics` become stale before the next command arrives"),
        "{errors}"
    );
}

#[test]
fn topic_memory_is_printed_with_its_history() {
    let bytes = |set: &[&str]| -> u64 {
        let output = run(&[&["check", REACH, "--json"], set].concat());
        let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let topics = answer["memory"].as_array().expect("an array").clone();
        assert_eq!(topics.len(), answer["plan"]["topics"].as_array().map(Vec::len).unwrap_or_default());
        topics.iter().map(|topic| topic["bytes"].as_u64().expect("a number")).sum()
    };
    let kept = bytes(&["--set", "topic.panda/joint_command.history=100"]);
    assert!(kept >= bytes(&[]) + 100 * 2_568, "a command takes 2,568 bytes");
    assert!(printed(&["check", REACH]).contains("shared memory of all topics"));
}

#[test]
fn component_without_a_budget_causes_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = std::fs::read_to_string(REACH).expect("the graph");
    let path = folder.path().join("graph.toml");
    std::fs::write(&path, graph.replace("budget    = \"200 us\"\n", "")).expect("written");
    let output = run(&["check", path.to_str().expect("a path of text")]);
    assert!(output.status.success());
    let warnings = text(&output.stderr);
    assert!(warnings.contains("warning: component `physics` has no budget"), "{warnings}");
    assert!(text(&output.stdout).contains("not provable"));
}

#[test]
fn timeline_is_text_picture_or_json() {
    let picture = printed(&["check", REACH, "--timeline", "svg"]);
    assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"), "nothing but the picture");

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("timeline.txt");
    let path = path.to_str().expect("a path of text");
    let answer = printed(&["check", REACH, "--timeline", "text", "--output", path]);
    let bars = std::fs::read_to_string(path).expect("the timeline");
    assert!(bars.contains("physics     █") && !answer.contains('█'));

    let data = json(&["check", REACH, "--json", "--span", "250 us"]);
    let timeline = &data["timeline"];
    assert_eq!((&timeline["length_ns"], &timeline["hyperperiod_ns"]), (&250_000.into(), &1_000_000.into()));
    assert_eq!(timeline["cores"][0]["lanes"][0]["segments"][0]["end_ns"], 250_000);
}

#[test]
fn timeline_output_requires_a_format() {
    let output = run(&["check", REACH, "--output", "nowhere.svg"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--timeline"));
}

/// The overheads that `check` counts with, given this folder of configuration, and their origin.
fn overheads(folder: &std::path::Path) -> (Value, String) {
    let output =
        motorium(&["check", REACH, "--json"]).env("XDG_CONFIG_HOME", folder).output().expect("it runs");
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    (answer["admission"]["overheads"].clone(), answer["overheads_origin"].as_str().expect("text").to_string())
}

#[test]
fn check_uses_saved_calibration_of_this_machine() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let (cautious, origin) = overheads(folder.path());
    assert!(origin.starts_with("cautious values; `motorium calibrate --save`"), "{origin}");

    let arguments = ["calibrate", REACH, "--for", "500 ms", "--save", "--json"];
    let output = motorium(&arguments).env("XDG_CONFIG_HOME", folder.path()).output().expect("it runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let (measured, origin) = overheads(folder.path());
    assert_eq!(measured, answer["overheads"]);
    assert_eq!(measured, answer["admission"]["overheads"]);
    assert!(origin.starts_with("as measured on this machine"), "{origin}");
    assert_ne!(measured, cautious);

    let file = folder.path().join("motorium/overheads.json");
    let saved = std::fs::read_to_string(&file).expect("saved");
    std::fs::write(&file, saved.replace("\"cores\": ", "\"cores\": 9")).expect("written");
    let (counted, origin) = overheads(folder.path());
    assert_eq!(counted, cautious);
    assert!(origin.contains("a different machine"), "{origin}");
    // as saved by an older motorium, with fewer numbers
    std::fs::write(&file, saved.replace("timer_ns", "other_ns")).expect("written");
    let (counted, origin) = overheads(folder.path());
    assert_eq!(counted, cautious);
    assert!(origin.contains("cannot be read"), "{origin}");
}

#[test]
fn run_refuses_an_unschedulable_graph_without_force() {
    let _machine = machine();
    let run = |more: &[&str]| {
        run(&[&["run", OVERLOADED, "--for", "300 ms", "--set", "realtime.lost_steps=1"], more].concat())
    };
    let refused = run(&[]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(refused.stdout.is_empty());
    let errors = text(&refused.stderr);
    assert!(errors.contains("(controller) = 1.368 > ") && errors.contains("not started"), "{errors}");
    let forced = run(&["--force", "--json"]);
    assert_eq!(forced.status.code(), Some(0), "{}", text(&forced.stderr));
    assert!(text(&forced.stderr).contains("(controller) = 1.368 > "));
    let report: Value = serde_json::from_slice(&forced.stdout).expect("JSON");
    assert!(report["components"][0]["steps"].as_u64().is_some_and(|steps| steps > 100), "{report}");
}
