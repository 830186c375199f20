//! `policy.cpg` and `policy.promp` in a running graph.

use crate::support::{self, Nothing};

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::launcher::Report;
use motorium::state::{JointCommand, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_policies::{CpgPolicy, ProMpPolicy};
use serde_json::json;

/// An arm that follows its position setpoints immediately and records them.
struct Follower {
    command: Input<JointCommand>,
    state: Output<JointState>,
    q: [f64; 3],
    v: [f64; 3],
    seen: Vec<Seen>,
}

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct Seen {
    pub(crate) q: Vec<f64>,
    v: Vec<f64>,
    effort: Vec<f64>,
    kp: Vec<f64>,
}

impl Component for Follower {
    const KIND: &'static str = "test.follower";
    const SUMMARY: &'static str = "an arm that follows its setpoints immediately";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointCommand>("joint_command", "setpoints");
        declare.output::<JointState>("joint_state", "joint positions");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            q: [0.5, 0.8, 0.8],
            v: [0.0; 3],
            seen: Vec::new(),
        })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        if let Some(command) = self.command.latest() {
            self.q.copy_from_slice(command.position());
            self.v.copy_from_slice(command.velocity());
            self.seen.push(Seen {
                q: command.position().to_vec(),
                v: command.velocity().to_vec(),
                effort: command.effort().to_vec(),
                kp: command.kp().to_vec(),
            });
        }
        let mut state = self.state.loan()?;
        state.set_count(3);
        state.position_mut().copy_from_slice(&self.q);
        state.velocity_mut().copy_from_slice(&self.v);
        state.effort_mut().fill(0.0);
        state.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(self.seen))
    }
}

pub(crate) fn run(kind: &str, config: &str, wiring: &str, seconds: f64) -> (Report, Vec<Seen>) {
    let graph = format!(
        r#"
name = "policy"
clock = "lockstep"
duration = "{} ms"

[robot.arm]
urdf = "planar-3r"

[component.arm]
kind = "test.follower"
rate = "1 kHz"
subscribe = {{ joint_command = "arm/joint_command" }}
publish = {{ joint_state = "arm/joint_state" }}

[component.policy]
kind = "{kind}"
robot = "arm"
trigger = "arm/joint_state"
subscribe = {{ joint_state = "arm/joint_state" }}
publish = {{ joint_command = "arm/joint_command" }}
{wiring}

[component.policy.config]
{config}
"#,
        (seconds * 1e3).round()
    );
    let kinds = [Kind::of::<Follower>(), Kind::of::<CpgPolicy>(), Kind::of::<ProMpPolicy>()];
    let report = support::run(std::path::Path::new("policy.toml"), graph, kinds);
    let seen = serde_json::from_value(report.results["arm"].clone()).unwrap();
    (report, seen)
}

pub(crate) fn assert_steady(report: &Report) {
    assert_eq!(support::faults(report), (Some(0), 0), "a step allocates or fails");
}

/// Checks that positions are continuous, and that velocities are their rates.
pub(crate) fn assert_smooth(seen: &[Seen]) {
    for pair in seen.windows(2) {
        for j in 0..3 {
            let slope = (pair[1].q[j] - pair[0].q[j]) / 1e-3;
            assert!((slope - pair[1].v[j]).abs() < 0.3, "{slope} {}", pair[1].v[j]);
        }
    }
}

const WALK: &str = r#"
gait = "walk"
frequency = 2.0
legs = [
    { joints = [{ joint = "joint1", amplitude = 0.3, offset = 0.4 }, { joint = "joint3", amplitude = 0.1, phase = 1.5 }] },
    { joints = [{ joint = "joint2", amplitude = 0.3, offset = 0.6 }] },
]"#;

#[test]
fn legs_swing_in_turn_from_standing_without_a_jump() {
    let (report, seen) = run("policy.cpg", WALK, "", 5.0);
    assert_steady(&report);
    assert!((seen[0].q[0] - 0.5).abs() < 1e-3, "it must start at the robot's position: {:?}", seen[0].q);
    assert_smooth(&seen);
    let settled = &seen[seen.len() - 1000..];
    let extremes = |j: usize| {
        settled.iter().map(|seen| seen.q[j]).fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(q), b.max(q)))
    };
    for (j, low, high) in [(0, 0.1, 0.7), (1, 0.3, 0.9), (2, -0.1, 0.1)] {
        let (a, b) = extremes(j);
        assert!((a - low).abs() < 1e-2 && (b - high).abs() < 1e-2, "joint {j}: {a} to {b}");
    }
    // a biped walk: half a stride apart
    for seen in settled {
        assert!((seen.q[0] - 0.4 + seen.q[1] - 0.6).abs() < 0.02, "{:?}", seen.q);
    }
    assert_eq!(seen[10].kp, [100.0, 60.0, 20.0], "the gains of the profile");
    let result = &report.results["policy"];
    assert_eq!((&result["gait"], &result["gait_changes"]), (&json!("walk"), &json!(0)));
    assert!((result["strides"].as_f64().unwrap() - 10.0).abs() < 0.1);
    assert!(result["pattern_error_rad"].as_f64().unwrap() < 1e-3);
}

#[test]
fn gait_frequency_and_amplitude_are_parameters() {
    let (report, seen) =
        run("policy.cpg", WALK, "params = { gait = \"bound\", frequency = 1.0, amplitude = 0.5 }", 5.0);
    assert_steady(&report);
    assert_eq!(report.results["policy"]["gait"], "bound");
    for seen in &seen[seen.len() - 1000..] {
        assert!((seen.q[0] - 0.4 - (seen.q[1] - 0.6)).abs() < 0.02, "both legs together: {:?}", seen.q);
        assert!((seen.q[0] - 0.4).abs() < 0.151);
    }
}

#[test]
fn phase_offsets_of_the_legs_change_their_gait() {
    // half a stride more than the walk, in which two legs are half a stride apart
    let offsets = "params = { phase_offsets = [0.0, 3.141592653589793], frequency = 1.0 }";
    let (report, seen) = run("policy.cpg", WALK, offsets, 5.0);
    assert_steady(&report);
    assert_smooth(&seen);
    assert_eq!(
        (&report.results["policy"]["gait"], &report.results["policy"]["gait_changes"]),
        (&json!("walk"), &json!(0))
    );
    for seen in &seen[seen.len() - 1000..] {
        assert!((seen.q[0] - 0.4 - (seen.q[1] - 0.6)).abs() < 0.02, "both legs together: {:?}", seen.q);
    }
}

#[test]
fn following_robot_keeps_its_gait_with_entrainment() {
    let (report, seen) = run("policy.cpg", WALK, "params = { entrainment = 4.0 }", 5.0);
    assert_steady(&report);
    assert_smooth(&seen);
    assert!(report.results["policy"]["pattern_error_rad"].as_f64().unwrap() < 0.2);
}

/// Two Gaussians per dimension: approximately a line from one weight to the other.
fn promp(from: f64, to: f64) -> String {
    let mean = format!("[{from}, {to}, {from}, {to}]");
    let rows: Vec<String> = (0..4)
        .map(|i| {
            format!(
                "[{}]",
                (0..4).map(|j| if i == j { "0.04" } else { "0.0" }).collect::<Vec<_>>().join(", ")
            )
        })
        .collect();
    format!(
        "{{ basis = {{ kind = \"gaussian\", count = 2, overlap = 0.7 }}, dimensions = 2, duration = 1.0, noise = 0.0, mean = {mean}, covariance = [{}] }}",
        rows.join(", ")
    )
}

#[test]
fn joints_follow_the_mean_through_a_via_point() {
    let config = format!(
        "primitives = [{}]\njoints = [\"joint3\", \"joint1\"]\nduration = \"3 s\"\nvia = [{{ at = 0.5, position = [0.6, 0.4] }}]",
        promp(0.7, 0.2)
    );
    let (report, seen) = run("policy.promp", &config, "", 4.0);
    assert_steady(&report);
    assert_smooth(&seen);
    assert!((seen[0].q[0] - 0.5).abs() < 1e-3 && (seen[0].q[2] - 0.8).abs() < 1e-3);
    let middle = &seen[1500];
    assert!((middle.q[2] - 0.6).abs() < 5e-3 && (middle.q[0] - 0.4).abs() < 5e-3, "{:?}", middle.q);
    assert!(seen.iter().all(|seen| seen.q[1] == 0.8), "joint2 is not moved");
    // gravity at the arm's position when the command was computed: one step earlier
    let arm = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
    let mut gravity = [0.0; 3];
    let down = nalgebra::Vector3::new(0.0, 0.0, -9.806_65);
    motorium_robots::Dynamics::new(&arm.model).gravity(&arm.model, &seen[1499].q, down, &mut gravity);
    for (found, expected) in middle.effort.iter().zip(gravity) {
        assert!((found - expected).abs() < 1e-9, "{:?} {gravity:?}", middle.effort);
    }
    let result = &report.results["policy"];
    assert_eq!((&result["movements"], &result["primitive"]), (&json!(1), &json!(0)));
}

#[test]
fn the_selected_primitive_runs_and_movements_repeat() {
    let config = format!(
        "primitives = [{}, {}]\njoints = [\"joint1\", \"joint2\"]\nrepeat = \"forever\"\ndwell = \"500 ms\"\njoint_command = {{ ease = \"100 ms\", kp = [1, 2, 3], kd = [1, 1, 1], gravity_compensation = false }}",
        promp(0.5, 0.2),
        promp(0.5, 1.0)
    );
    let (report, seen) = run("policy.promp", &config, "params = { primitive = 1 }", 4.0);
    assert_steady(&report);
    assert_smooth(&seen);
    assert_eq!(report.results["policy"]["movements"], 3);
    assert_eq!(report.results["policy"]["primitive"], 1);
    let end = &seen[1200];
    assert!(end.q[0] > 0.9 && end.effort == [0.0; 3] && end.kp == [1.0, 2.0, 3.0], "{end:?}");
}

fn refuse<C: Component>(config: serde_json::Value) -> (Option<String>, String) {
    let error = support::refusal::<C>(config, Some("planar-3r"), std::path::Path::new("."));
    (error.key, error.message)
}

#[test]
fn invalid_configurations_are_refused_with_their_key() {
    let leg = |joint: &str| json!({ "joints": [{ "joint": joint, "amplitude": 0.1 }] });
    let (key, message) =
        refuse::<CpgPolicy>(json!({ "gait": "trot", "legs": [leg("joint1"), leg("joint2")] }));
    assert_eq!(key.as_deref(), Some("gait"));
    assert_eq!(message, "the trot gait is not defined for 2 legs: use walk or bound");
    let (key, message) =
        refuse::<CpgPolicy>(json!({ "gait": "walk", "legs": [leg("joint1"), leg("joint9")] }));
    assert_eq!(key.as_deref(), Some("legs[1].joints[0].joint"));
    assert_eq!(message, "robot `arm` has no joint \"joint9\"");
    let (_, message) = refuse::<CpgPolicy>(json!({ "gait": "walk", "legs": [leg("joint1"), leg("joint1")] }));
    assert_eq!(message, "joint \"joint1\" is named twice");
    let (key, _) = refuse::<ProMpPolicy>(json!({ "primitives": [] }));
    assert_eq!(key.as_deref(), Some("primitives"));
    let (key, message) = refuse::<ProMpPolicy>(json!({ "primitives": ["no-such-file.json"] }));
    assert_eq!(key.as_deref(), Some("primitives[0]"));
    assert!(message.contains("no-such-file.json"), "{message}");
}
