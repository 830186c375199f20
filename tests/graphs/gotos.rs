//! `motorium goto`: an arm moves to goals while its graph runs, and refuses goals out of reach.

use std::path::Path;
use std::process::{Command, Stdio};

use motorium::launcher::Exit;
use motorium_robots::Kinematics;

use crate::MOTORIUM;
use crate::program::{complaint, json, printed};
use crate::support::{Run, await_that, machine, signal};

/// Simulated time follows the wall clock, so that values from outside arrive in time.
const PACED: [&str; 6] = ["--clock", "lockstep", "--pace", "1", "--for", "120 s"];

/// The newest value of a topic of the run, as JSON.
fn newest(run: &str, topic: &str) -> serde_json::Value {
    json(&["topic", "echo", topic, "--run", run, "--count", "1", "--json"])["value"].take()
}

/// Distance of the end effector in a joint state from a position, m.
fn distance(state: &serde_json::Value, position: [f64; 3]) -> f64 {
    let positions = state["position"].as_array().expect("a list");
    let q: Vec<f64> = positions.iter().map(|position| position.as_f64().expect("a number")).collect();
    let panda = motorium_robots::load("panda", Path::new(".")).expect("it is in the catalogue");
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, &q);
    let frame = panda.end_effector(None).expect("it has one");
    let pose = kinematics.pose(&panda.model, frame).translation;
    let off = position.iter().enumerate().map(|(axis, goal)| pose.vector[axis] - goal);
    off.map(|off| off * off).sum::<f64>().sqrt()
}

#[test]
fn an_arm_goes_to_poses_joints_and_grips() {
    let _machine = machine();
    let run = Run::start(Path::new("graphs/panda-goto.toml"), &PACED);
    let id = run.folder.id().to_string();
    let id = id.as_str();
    let goto = |options: &[&str]| json(&[&["goto", id, "--json"], options].concat());

    let reached = goto(&["--position", "0.4,0.15,0.5", "--gripper", "close"]);
    assert!(reached["error"].as_f64().expect("a number") <= 0.01, "{reached}");
    let state = newest(id, "panda/joint_state");
    assert!(distance(&state, [0.4, 0.15, 0.5]) < 0.01, "{state}");
    assert!(state["position"][7].as_f64().expect("a number") < 0.002, "{state}");
    assert_eq!(newest(id, "panda/goal_status")["state"], 3);

    goto(&["--joints", "panda_joint1=-0.4"]);
    let turned = newest(id, "panda/joint_state");
    assert!((turned["position"][0].as_f64().expect("a number") + 0.4).abs() < 0.01, "{turned}");
    let text = printed(&["goto", id, "--pose", "home"]);
    assert!(text.starts_with("reached in "), "{text}");
    let home = newest(id, "panda/joint_state");
    assert!((home["position"][3].as_f64().expect("a number") + 2.356).abs() < 0.01, "{home}");

    let status = newest(id, "panda/goal_status");
    for (options, expected) in [
        (&["--position", "2,0,0.5"][..], "the goal was not sent: the position is"),
        (&["--position", "0.4,0,-0.6"], "the goal was not sent: "),
        (&["--joints", "panda_joint4=1"], "joint `panda_joint4` at 1, outside of its range"),
        (&["--position", "0.4,0,0.5", "--joints", "panda_joint1=0"], "but the pose determines it"),
        (&["--pose", "home", "--component", "physics"], "no component `physics` that accepts goals"),
    ] {
        let text = complaint(&[&["goto", id], options].concat());
        assert!(text.contains(expected), "{options:?}: {text}");
    }
    assert_eq!(newest(id, "panda/goal_status"), status, "refused goals are not sent");
    printed(&["stop", "--run", id]);
    let ended = run.finish();
    let result = &ended.report().results["policy"];
    assert_eq!(ended.report().exit, Exit::Interrupted, "{}", ended.stderr);
    assert_eq!((&result["goals_received"], &result["goals_refused"]), (&3.into(), &0.into()), "{result}");
    assert_eq!(result["goals_missed"], 0, "{result}");
}

#[test]
fn newer_goal_replaces_the_current_one() {
    let _machine = machine();
    let run = Run::start(Path::new("graphs/panda-goto.toml"), &PACED);
    let id = run.folder.id().to_string();
    let slow = Command::new(MOTORIUM)
        .args(["goto", &id, "--joints", "panda_joint1=1.5", "--duration", "60 s"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("motorium starts");
    await_that("the first goal", || run.published("panda/goal_status") > 1);
    signal(slow.id(), rustix::process::Signal::INT);
    let output = slow.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("interrupted; the robot continues to its goal"), "{text}");

    let reached = json(&["goto", &id, "--json", "--joints", "panda_joint1=-0.3"]);
    assert!(reached["seconds"].as_f64().expect("a number") < 40.0, "{reached}");
    // a value that `goto` would not send is refused by the policy
    printed(&["topic", "pub", "panda/goal", "number=7 has_position=1 position=[3, 0, 0]", "--run", &id]);
    let refused = || newest(&id, "panda/goal_status");
    await_that("the refusal", || refused()["goal"] == 7);
    let refused = refused();
    assert_eq!(refused["state"], 4, "{refused}");
    let text = refused["text"].as_str().expect("a text");
    assert!(text.contains("from the first joint, and the links reach"), "{text}");
    printed(&["stop", "--run", &id]);
    let ended = run.finish();
    let result = &ended.report().results["policy"];
    assert_eq!((&result["goals_received"], &result["goals_refused"]), (&3.into(), &1.into()), "{result}");
}

#[test]
fn goto_names_the_port_that_a_graph_lacks() {
    let _machine = machine();
    let run = Run::start(Path::new("graphs/panda-waypoints.toml"), &PACED);
    let id = run.folder.id().to_string();
    let text = complaint(&["goto", &id, "--pose", "home"]);
    assert!(text.contains("port `goal` of component `policy` is not wired"), "{text}");
    printed(&["stop", "--run", &id]);
    run.finish();
}
