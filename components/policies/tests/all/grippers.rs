//! Grippers of the goals of `policy.dmp`.

use std::path::Path;

use motorium::state::{MotionGoal, PoseTarget};
use motorium::testing::{Graph, Instance, Probe};
use motorium_policies::DmpPolicy;

use crate::support::refusal;

const GOALS: &str = r#"{
    start = { position = [0.4, 0.0, 0.4], rpy = [3.14159, 0.0, 0.0] },
    goals = [
        { offset = [0.1, 0.0, 0.0], duration = "1 s", gripper = "open" },
        { gripper = "close", dwell = "200 ms" },
        { offset = [0.0, 0.1, 0.0], duration = "500 ms" },
        { gripper = 0.02, duration = "300 ms" },
    ],
}"#;

fn policy() -> Instance {
    let config: toml::Table = format!("config = {}", GOALS.replace('\n', " ")).parse().unwrap();
    Instance::of::<DmpPolicy>("policy")
        .robot("panda")
        .rate("1 kHz")
        .publish("target", "target")
        .set("config", config["config"].clone())
}

fn graph(policy: Instance) -> Graph {
    Graph::new("grippers-test").robot("panda", "panda").with(policy)
}

/// Time (ms), number, finger position and duration of each published goal.
fn published(policy: Instance) -> Vec<(u64, u64, f64, f64)> {
    let fingers = Probe::<MotionGoal>::for_topic("fingers").triggered();
    let target = Probe::<PoseTarget>::for_topic("target");
    let report = graph(policy.publish("fingers", "fingers")).with(&fingers).with(&target).run("3 s").unwrap();
    let component = report.components.iter().find(|component| component.name == "policy").unwrap();
    assert_eq!((component.allocations, component.errors), (Some(0), 0));
    let end = target.values().last().copied().unwrap();
    assert!((end.position[0] - 0.5).abs() < 1e-9 && (end.position[1] - 0.1).abs() < 1e-9, "{end:?}");
    let samples = fingers.samples();
    let goal = |goal: &MotionGoal| {
        assert!((0..7).all(|joint| goal.joint_at(joint).is_none()), "the arm has no joint goals");
        (goal.number, goal.joint_at(7).unwrap(), goal.duration)
    };
    let rows = samples.iter().map(|sample| (sample.time_ns / 1_000_000, goal(&sample.value)));
    rows.map(|(time, (number, position, duration))| (time, number, position, duration)).collect()
}

#[test]
fn grippers_are_published_when_their_goals_start() {
    let expected = [(0, 1, 0.04, 1.0), (1000, 2, 0.0, 0.2), (1900, 4, 0.02, 0.3)];
    let published = published(policy());
    assert_eq!(published.len(), expected.len(), "{published:?}");
    for (found, expected) in published.iter().zip(expected) {
        assert!(found.0.abs_diff(expected.0) <= 1, "{found:?}, expected {expected:?}");
        assert_eq!((found.1, found.2, found.3), (expected.1, expected.2, expected.3));
    }
}

#[test]
fn faster_policy_shortens_the_finger_motion() {
    let published = published(policy().parameter("speed", 2.0));
    let durations: Vec<f64> = published.iter().map(|row| row.3).collect();
    assert_eq!(durations, [0.5, 0.1, 0.15]);
}

#[test]
fn unwired_finger_output_prevents_the_start() {
    let error = graph(policy()).run("1 s").unwrap_err().to_string();
    assert!(error.contains("output `fingers` is not wired"), "{error}");
}

#[test]
fn impossible_grippers_are_refused_with_their_key() {
    for (robot, gripper, expected) in [
        ("panda", serde_json::json!(0.5), "outside of its range 0 to 0.04"),
        ("ur5e", serde_json::json!("open"), "has no `fingers`"),
    ] {
        let goals = serde_json::json!([{ "offset": [0, 0, 0.1], "duration": "1 s" }, { "gripper": gripper }]);
        let config = serde_json::json!({ "goals": goals });
        let error = refusal::<DmpPolicy>(config, Some(robot), Path::new("."));
        assert_eq!(error.key.as_deref(), Some("goals[1].gripper"));
        assert!(error.message.contains(expected), "{}", error.message);
    }
}
