//! `policy.dmp` in a running graph.

use std::path::Path;

use crate::support::{self, Nothing};
use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::launcher::Report;
use motorium::state::{JointState, PoseTarget};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_policies::DmpPolicy;
use motorium_robots::Kinematics;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// The joint state of a Panda at home, from tick 10 on.
struct Home {
    state: Output<JointState>,
    q: Vec<f64>,
}

impl Component for Home {
    const KIND: &'static str = "test.home";
    const SUMMARY: &'static str = "an arm at home";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointState>("joint_state", "home");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { state: setup.output("joint_state")?, q: home().1 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if tick.index < 10 {
            return Ok(());
        }
        let mut state = self.state.loan()?;
        state.set_count(self.q.len());
        state.position_mut().copy_from_slice(&self.q);
        state.velocity_mut().fill(0.0);
        state.effort_mut().fill(0.0);
        state.publish()
    }
}

/// Records every target with the tick at which it arrived.
struct Recorder {
    target: Input<PoseTarget>,
    seen: Vec<Seen>,
}

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Seen {
    tick: u64,
    position: [f64; 3],
    orientation: [f64; 4],
    velocity: [f64; 3],
    goal: u64,
    at_goal: u64,
}

impl Component for Recorder {
    const KIND: &'static str = "test.recorder";
    const SUMMARY: &'static str = "records targets";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<PoseTarget>("target", "the target");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { target: setup.input("target")?, seen: Vec::new() })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if let Some(target) = self.target.latest() {
            self.seen.push(Seen {
                tick: tick.index,
                position: target.position,
                orientation: target.orientation,
                velocity: target.linear_velocity,
                goal: target.goal,
                at_goal: target.at_goal,
            });
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!(self.seen))
    }
}

/// Pose of the Panda's hand at home, and its joint positions.
fn home() -> (Isometry3<f64>, Vec<f64>) {
    let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
    let q = panda.profile.unwrap().home(&panda.model).unwrap();
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, q.as_slice());
    let frame = panda.model.frame("panda_hand_tcp").unwrap();
    (kinematics.pose(&panda.model, frame), q.as_slice().to_vec())
}

fn run(wiring: &str, config: &str) -> (Report, Vec<Seen>) {
    let graph = format!(
        r#"
name = "policy"
clock = "lockstep"
duration = "3 s"

[robot.panda]
urdf = "panda"

[component.home]
kind = "test.home"
rate = "1 kHz"
publish = {{ joint_state = "panda/joint_state" }}

[component.policy]
kind = "policy.dmp"
rate = "1 kHz"
publish = {{ target = "panda/target" }}
{wiring}

[component.policy.config]
{config}

[component.recorder]
kind = "test.recorder"
rate = "1 kHz"
subscribe = {{ target = "panda/target" }}
"#
    );
    let kinds = [Kind::of::<Home>(), Kind::of::<DmpPolicy>(), Kind::of::<Recorder>()];
    let report = support::run(Path::new("policy.toml"), graph, kinds);
    let seen = serde_json::from_value(report.results["recorder"].clone()).unwrap();
    (report, seen)
}

const MEASURED: &str = r#"robot = "panda"
subscribe = { joint_state = "panda/joint_state" }"#;

const GOALS: &str = r#"
goals = [
    { offset = [0.1, 0.0, -0.1], duration = "1 s", dwell = "250 ms" },
    { position = [0.4, 0.3, 0.5], rpy = [3.0, 0.2, 0.5], duration = "800 ms", shape = { arc = [0.0, 0.0, 0.1] } },
    { offset = [0.0, -0.2, 0.0], duration = "500 ms" },
]"#;

fn distance(seen: &Seen, place: Vector3<f64>) -> f64 {
    (Vector3::from(seen.position) - place).norm()
}

fn turn(seen: &Seen) -> UnitQuaternion<f64> {
    let [x, y, z, w] = seen.orientation;
    UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z))
}

#[test]
fn hand_moves_from_its_current_pose_through_all_goals() {
    let (report, seen) = run(MEASURED, GOALS);
    let (start, _) = home();
    let first = &seen[0];
    assert!(
        (10..=11).contains(&first.tick),
        "nothing is published before the end effector's pose is known: {}",
        first.tick
    );
    assert!(
        distance(first, start.translation.vector) < 1e-12 && turn(first).angle_to(&start.rotation) < 1e-7
    );
    assert_eq!((first.goal, first.at_goal), (1, 0));

    let at = |milliseconds: usize| &seen[milliseconds];
    let one = start.translation.vector + Vector3::new(0.1, 0.0, -0.1);
    assert!(distance(at(1000), one) < 1e-12 && turn(at(1000)).angle_to(&start.rotation) < 1e-7);
    assert_eq!([at(999).at_goal, at(1000).at_goal, at(1250).at_goal, at(1251).at_goal], [0, 1, 1, 0]);
    assert_eq!([at(1250).goal, at(1251).goal], [1, 2]);

    let two = Vector3::new(0.4, 0.3, 0.5);
    let tilted = UnitQuaternion::from_euler_angles(3.0, 0.2, 0.5);
    assert!(distance(at(2050), two) < 1e-4 && turn(at(2050)).angle_to(&tilted) < 1e-7);
    let middle = at(1650).position[2];
    assert!((middle - (0.5 * (one.z + two.z) + 0.1)).abs() < 1e-4, "the arc is at its apex: {middle}");

    let last = seen.last().unwrap();
    assert!(distance(last, two - Vector3::new(0.0, 0.2, 0.0)) < 1e-6 && turn(last).angle_to(&tilted) < 1e-7);
    assert_eq!((last.goal, last.at_goal), (3, 1));
    let expected = serde_json::json!({ "goals_started": 3, "goals": 3, "finished": true });
    assert_eq!(report.results["policy"], expected);
    let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
    assert_eq!((policy.steps, support::faults(&report)), (3000, (Some(0), 0)));
}

#[test]
fn a_configured_start_needs_no_robot() {
    let start = "start = { position = [0.1, 0.2, 0.3], rpy = [0.0, 0.0, 1.0] }";
    let (_, seen) = run("", &format!("{start}\nrepeat = \"forever\"\n{GOALS}"));
    assert!(distance(&seen[0], Vector3::new(0.1, 0.2, 0.3)) < 1e-12);
    assert!(distance(&seen[1000], Vector3::new(0.2, 0.2, 0.2)) < 1e-12);
    // the first goal follows the last
    assert_eq!(seen.last().unwrap().goal, 4);
}

#[test]
fn the_speed_is_a_parameter() {
    let (_, seen) = run(&format!("{MEASURED}\nparams = {{ speed = 0.5 }}"), GOALS);
    let arrival = seen.iter().position(|seen| seen.at_goal == 1).unwrap();
    assert_eq!(arrival, 2000);
    let peak =
        |seen: &[Seen]| seen.iter().map(|seen| Vector3::from(seen.velocity).norm()).fold(0.0, f64::max);
    let expected = 1.875 * 0.5 * 0.02_f64.sqrt();
    assert!((peak(&seen[..2000]) - expected).abs() < 1e-6);
}

fn refuse(config: serde_json::Value) -> (Option<String>, String) {
    let error = support::refusal::<DmpPolicy>(config, Some("panda"), Path::new("."));
    (error.key, error.message)
}

#[test]
fn invalid_configurations_are_refused_with_their_key() {
    let one = |goal: serde_json::Value| refuse(serde_json::json!({ "goals": [goal] }));
    let key = |(key, _): (Option<String>, String)| key.unwrap();
    assert_eq!(key(refuse(serde_json::json!({ "goals": [] }))), "goals");
    assert_eq!(key(one(serde_json::json!({ "duration": "1 s" }))), "goals[0]");
    let both = serde_json::json!({ "position": [0, 0, 0], "offset": [0, 0, 0], "duration": "1 s" });
    assert_eq!(key(one(both)), "goals[0].offset");
    let hasty = serde_json::json!({ "offset": [0, 0, 0], "duration": "1 us" });
    assert_eq!(
        one(hasty),
        (
            Some("goals[0].duration".into()),
            "goal 0 has a duration of 0.000001 s, expected at least 0.001 s".into()
        )
    );
    let quaternion =
        serde_json::json!({ "offset": [0, 0, 0], "orientation": [1, 1, 0, 0], "duration": "1 s" });
    assert_eq!(key(one(quaternion)), "goals[0].orientation");
    let (_, message) = one(serde_json::json!({ "offset": [0, 0, 0], "duration": 2.0 }));
    assert!(message.contains("expected a time with its unit"), "{message}");
    let settings =
        serde_json::json!({ "settings": { "kernels": 2 }, "displacement": [1.0], "weights": [[0.0, 0.0]] });
    let learned =
        serde_json::json!({ "offset": [0, 0, 0], "duration": "1 s", "shape": { "primitive": settings } });
    let (place, message) = one(learned);
    assert_eq!(place.as_deref(), Some("goals[0].shape"));
    assert_eq!(message, "the learned shape has 1 dimensions, expected 3: the position of the end effector");
    let goal = serde_json::json!({ "offset": [0, 0, 0], "duration": "1 s" });
    let (place, message) = refuse(serde_json::json!({ "goals": [goal], "frame": "panda_hnad_tcp" }));
    assert_eq!(place.as_deref(), Some("frame"));
    assert!(message.contains("panda_hand_tcp"), "the nearest name is offered: {message}");
}

#[test]
fn missing_robot_and_start_are_reported() {
    let config = serde_json::json!({ "goals": [{ "offset": [0, 0, 0], "duration": "1 s" }] });
    let advice = support::refusal::<DmpPolicy>(config, None, Path::new(".")).advice.unwrap();
    assert!(advice.contains("robot = \"NAME\"") && advice.contains("`start`"), "{advice}");
}
