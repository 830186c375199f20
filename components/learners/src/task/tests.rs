//! Tasks: their file, the derived range, and their terms.

use super::*;

const TEXT: &str = r#"
title = "Balance"
robot = "cart-pole"
step = 0.005
decimation = 4
duration = 10.0
observations = [{ term = "joint_positions" }, { term = "joint_velocities", scale = 0.5 }]
rewards = [
    { term = "alive", weight = 2.0 },
    { term = "joint_position", joint = "hinge", target = 3.0, shape = "kernel", width = 0.5, weight = 0.5 },
    { term = "joint_velocity", joint = "hinge", shape = "square", clip = [0.0, 4.0], weight = -0.1 },
]
terminations = [{ term = "joint_position", joint = "slider", outside = [-2.0, 2.0] }]
[start]
position = [0.0, 3.141592653589793]
[action]
joints = ["slider", "hinge"]
kind = "effort"
scale = [10.0, 0.0]
default_pose = [0.0, 3.141592653589793]
clip = [-1.0, 1.0]
"#;

#[test]
fn range_of_the_reward_is_derived() {
    let task = Task::parse(TEXT).expect("a task");
    let [low, high] = task.reward_range().expect("bounded terms");
    assert!((low - 1.6).abs() < 1e-15 && (high - 2.5).abs() < 1e-15, "{low} {high}");
    // a cosine around a target outside of its range
    let shaped = TEXT.replace(
        r#"{ term = "alive", weight = 2.0 }"#,
        r#"{ term = "joint_cosine", joints = ["hinge"], target = 3.0, shape = "square", weight = -1.0 }"#,
    );
    let [low, high] = Task::parse(&shaped).expect("a task").reward_range().expect("bounded terms");
    assert!((low + 16.4).abs() < 1e-14 && (high + 3.5).abs() < 1e-14, "{low} {high}");
}

#[test]
fn rewards_that_can_be_infinite_are_refused() {
    for (from, to) in [(", clip = [0.0, 4.0]", ""), (r#", shape = "kernel", width = 0.5"#, "")] {
        assert!(TEXT.contains(from), "{from}");
        let error = Task::parse(&TEXT.replace(from, to)).expect_err("an unbounded term");
        assert!(matches!(error, TaskError::Unbounded { .. }), "{error}");
    }
}

#[test]
fn mistakes_in_a_task_are_named() {
    for (from, to, message) in [
        ("step = 0.005", "step = 0.0", "`step`: found 0, expected a time above 0 s"),
        ("decimation = 4", "decimation = 0", "`decimation`: found 0, expected at least 1"),
        ("duration = 10.0", "duration = 0.001", "`duration`: found 0.001, expected at least one step"),
        ("width = 0.5", "width = -0.5", "`rewards[1].width`: found -0.5, expected a width above 0"),
        ("joint = \"hinge\", target", "target", "`rewards[1].joint`: found none, expected a joint"),
        ("outside = [-2.0, 2.0]", "outside = [2.0, -2.0]", "`terminations[0]`: found Some([2.0, -2.0])"),
        (", outside = [-2.0, 2.0]", "", "`terminations[0]`: found none, expected one of `outside`"),
        ("\"slider\", \"hinge\"]\nkind", "\"slider\"]\nkind", "`action.default_pose`: found 2 numbers"),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let error = Task::parse(&TEXT.replacen(from, to, 1)).expect_err(to);
        assert!(error.to_string().starts_with(message), "{error}");
    }
    let unknown = Task::parse(&TEXT.replace("title", "titles")).expect_err("an unknown key");
    assert!(unknown.to_string().contains("unknown field `titles`"), "{unknown}");
}

#[test]
fn the_policy_of_a_task_has_its_terms() {
    let task = Task::parse(TEXT).expect("a task");
    let policy = Policy::parse(&task.policy_text().expect("a policy")).expect("a policy");
    assert_eq!((policy.rate, policy.inputs()), (50.0, Ok(4)));
    assert_eq!(policy.robot.as_deref(), Some("cart-pole"));
    assert_eq!(policy.network, NETWORK);
}

#[test]
fn terminations_are_met_inside_or_outside() {
    let task = Task::parse(TEXT).expect("a task");
    let outside = &task.terminations[0];
    assert!(!outside.is_met(2.0) && outside.is_met(2.001) && outside.is_met(-2.001));
    let inside = Termination { outside: None, inside: Some([0.0, 1.0]), ..outside.clone() };
    assert!(inside.is_met(0.5) && !inside.is_met(1.5));
}
