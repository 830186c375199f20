//! `policy.joint_targets` with single actions.

use std::path::Path;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::launcher::Report;
use motorium::state::{Action, JointCommand, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_policies::JointTargetsPolicy;
use serde_json::json;

use crate::chunks::ChunkProducer;
use crate::support;

/// An arm that follows its position setpoints immediately, and records every command with its time.
pub(crate) struct Arm {
    command: Input<JointCommand>,
    state: Output<JointState>,
    q: [f64; 3],
    seen: Vec<Seen>,
}

/// A command.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct Seen {
    /// ms
    pub(crate) time: u64,
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    effort: Vec<f64>,
    kp: Vec<f64>,
    kd: Vec<f64>,
}

impl Component for Arm {
    const KIND: &'static str = "test.arm";
    const SUMMARY: &'static str = "an arm that follows its setpoints immediately";
    type Config = support::Nothing;

    fn declare(_: &support::Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointCommand>("joint_command", "setpoints");
        declare.output::<JointState>("joint_state", "measured joints");
        Ok(())
    }

    fn configure(_: support::Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            q: [0.5, 0.8, 0.8],
            seen: Vec::new(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if let Some(command) = self.command.next_unread() {
            if command.kp().iter().all(|kp| *kp > 0.0) {
                self.q.copy_from_slice(command.position());
            }
            self.seen.push(Seen {
                time: tick.time_ns / 1_000_000,
                q: command.position().to_vec(),
                v: command.velocity().to_vec(),
                effort: command.effort().to_vec(),
                kp: command.kp().to_vec(),
                kd: command.kd().to_vec(),
            });
        }
        let mut state = self.state.loan()?;
        state.set_count(3);
        state.position_mut().copy_from_slice(&self.q);
        state.velocity_mut().fill(0.0);
        state.effort_mut().fill(0.0);
        state.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(self.seen))
    }
}

/// Publishes actions at 50 Hz within time intervals.
struct Producer {
    action: Output<Action>,
    config: ProducerConfig,
}

/// The published action and its intervals.
#[derive(serde::Deserialize, schemars::JsonSchema)]
struct ProducerConfig {
    /// Intervals in ms.
    spans: Vec<[u64; 2]>,
    value: Vec<f64>,
    /// Increment per step.
    slope: f64,
}

impl Component for Producer {
    const KIND: &'static str = "test.producer";
    const SUMMARY: &'static str = "publishes actions";
    type Config = ProducerConfig;

    fn declare(_: &ProducerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Action>("action", "actions");
        Ok(())
    }

    fn configure(config: ProducerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { action: setup.output("action")?, config })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let time = tick.time_ns / 1_000_000;
        if !self.config.spans.iter().any(|[from, to]| (*from..*to).contains(&time)) {
            return Ok(());
        }
        let mut action = self.action.loan()?;
        action.set_count(self.config.value.len());
        for (slot, value) in action.value_mut().iter_mut().zip(&self.config.value) {
            *slot = value + self.config.slope * tick.index as f64;
        }
        action.publish()
    }
}

/// Runs the arm for some seconds with a producer and the `config` table of the policy.
pub(crate) fn run(producer: &str, port: &str, config: &str, seconds: f64) -> (Report, Vec<Seen>) {
    let graph = format!(
        r#"
name = "joint-targets"
clock = "lockstep"
duration = "{} ms"

[robot.arm]
urdf = "planar-3r"

[component.producer]
{producer}
publish = {{ {port} = "arm/{port}" }}

[component.arm]
kind = "test.arm"
rate = "1 kHz"
subscribe = {{ joint_command = "arm/joint_command" }}
publish = {{ joint_state = "arm/joint_state" }}

[component.policy]
kind = "policy.joint_targets"
robot = "arm"
trigger = "arm/joint_state"
subscribe = {{ joint_state = "arm/joint_state", {port} = "arm/{port}" }}
publish = {{ joint_command = "arm/joint_command" }}

[component.policy.config]
{config}
"#,
        (seconds * 1e3).round()
    );
    let kinds = [
        Kind::of::<Arm>(),
        Kind::of::<Producer>(),
        Kind::of::<ChunkProducer>(),
        Kind::of::<JointTargetsPolicy>(),
    ];
    let report = support::run(Path::new("policy.toml"), graph, kinds);
    let seen = serde_json::from_value(report.results["arm"].clone()).unwrap();
    assert_eq!(support::faults(&report), (Some(0), 0), "a step allocates or fails");
    (report, seen)
}

/// A producer of actions at 50 Hz.
fn producer(spans: &str, value: &str, slope: f64) -> String {
    format!(
        "kind = \"test.producer\"\nrate = \"50 Hz\"\nconfig = {{ spans = {spans}, value = {value}, slope = {slope:?} }}"
    )
}

/// Returns the commands after a time, ms.
fn after(seen: &[Seen], time: u64) -> &Seen {
    seen.iter().find(|seen| seen.time > time).unwrap_or_else(|| panic!("no command after {time} ms"))
}

const POLICY: &str = r#"[component.policy.config.policy]
rate = 50.0
action = { joints = ["joint3", "joint1"], scale = [0.5, 0.1], offset = [0.0, 0.2], default_pose = [0.4, 0.3], clip = [-2.0, 2.0] }
"#;

#[test]
fn actions_command_joints_by_name() {
    let (report, seen) = run(&producer("[[0, 2000]]", "[1.0, -5.0]", 0.0), "action", POLICY, 1.0);
    let end = seen.last().unwrap();
    // joint3: 0.4 + 0.5; joint1: 0.3 + 0.2 - 0.1 * 2 (clipped); joint2 stays
    let expected = [0.3, 0.8, 0.9];
    assert!(end.q.iter().zip(expected).all(|(q, expected)| (q - expected).abs() < 1e-12), "{:?}", end.q);
    assert_eq!((&end.kp[..], &end.kd[..]), (&[100.0, 60.0, 20.0][..], &[20.0, 8.0, 2.0][..]));
    assert_eq!(end.effort, [0.0; 3]);
    // the motion starts at the robot's position
    assert!(seen[..20].iter().all(|seen| (seen.q[2] - 0.8).abs() < 1e-2), "{:?}", seen[19].q);
    assert_eq!(report.results["policy"]["actions"], 50);
    assert_eq!(report.results["policy"]["stale"], 0);
}

#[test]
fn joint_order_does_not_change_the_motion() {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut motions = orders.map(|order| {
        let pick = |values: [&str; 3]| order.map(|index| values[index]).join(", ");
        let config = format!(
            "[component.policy.config.policy]\nrate = 50.0\naction = {{ joints = [{}], scale = [{}], offset = [{}], \
             default_pose = [{}], kp = [{}], kd = 1.5 }}",
            pick(["\"joint1\"", "\"joint2\"", "\"joint3\""]),
            pick(["0.5", "0.25", "1.0"]),
            pick(["0.0", "0.1", "-0.1"]),
            pick(["0.3", "0.7", "0.6"]),
            pick(["30.0", "20.0", "10.0"]),
        );
        let value = format!("[{}]", pick(["0.4", "-0.8", "0.2"]));
        let (_, seen) = run(&producer("[[0, 2000]]", &value, 0.0), "action", &config, 0.8);
        seen
    });
    let first = motions[0].split_off(0);
    assert!((first.last().unwrap().q[1] - 0.6).abs() < 1e-12, "{:?}", first.last());
    assert_eq!(first.last().unwrap().kp, [30.0, 20.0, 10.0]);
    for motion in &motions[1..] {
        assert_eq!(motion.len(), first.len());
        assert!(motion.iter().zip(&first).all(|(one, other)| one.q == other.q && one.kp == other.kp));
    }
}

#[test]
fn stale_actions_ease_to_the_default_pose_and_back() {
    let spans = "[[0, 700], [1500, 3000]]";
    let (report, seen) = run(&producer(spans, "[1.0, 0.0]", 0.0), "action", POLICY, 2.2);
    // the last action is for 680 ms and holds for 30 ms
    assert!((after(&seen, 709).q[2] - 0.9).abs() < 1e-12);
    let leaving = seen.iter().find(|seen| seen.time > 600 && seen.q[2] < 0.9 - 1e-9).unwrap();
    assert!((711..=713).contains(&leaving.time), "{}", leaving.time);
    let default = after(&seen, 1400);
    assert!((default.q[0] - 0.3).abs() < 1e-12 && (default.q[2] - 0.4).abs() < 1e-12, "{default:?}");
    assert!((after(&seen, 2100).q[2] - 0.9).abs() < 1e-12);
    for pair in seen.windows(2) {
        assert!((pair[1].q[2] - pair[0].q[2]).abs() < 2.2e-3, "{pair:?}");
    }
    assert_eq!(report.results["policy"]["stale"], 1);
}

#[test]
fn stale_actions_stop_commands_if_configured() {
    let config = format!("when_stale = \"stop\"\nhold = \"100 ms\"\n{POLICY}");
    let (_, seen) = run(&producer("[[0, 700]]", "[1.0, 0.0]", 0.0), "action", &config, 1.5);
    assert!((780..=783).contains(&seen.last().unwrap().time), "{}", seen.last().unwrap().time);
    let config = format!("when_stale = \"hold\"\n{POLICY}");
    let (_, seen) = run(&producer("[[0, 700]]", "[1.0, 0.0]", 0.0), "action", &config, 1.5);
    let end = seen.last().unwrap();
    assert!((end.q[2] - 0.9).abs() < 1e-12 && end.time >= 1498, "{end:?}");
}

#[test]
fn interpolated_actions_are_reached_a_period_later() {
    let config = format!("interpolate = true\nease = \"0 ms\"\n{POLICY}");
    let (_, seen) = run(&producer("[[0, 2000]]", "[-1.0, 0.0]", 0.02), "action", &config, 1.0);
    let motion: Vec<&Seen> = seen.iter().filter(|seen| (100..900).contains(&seen.time)).collect();
    for pair in motion.windows(2) {
        // 0.5 * 0.02 in 20 ms
        assert!((pair[1].q[2] - pair[0].q[2] - 5e-4).abs() < 1e-9, "{pair:?}");
    }
}

#[test]
fn velocities_and_efforts_omit_gains() {
    let policy = |kind: &str| {
        format!(
            "[component.policy.config.policy]\nrate = 50.0\naction = {{ joints = [\"joint2\"], kind = \"{kind}\", \
             scale = 2.0, default_pose = [0.7] }}"
        )
    };
    let (_, seen) = run(&producer("[[0, 500]]", "[0.4]", 0.0), "action", &policy("velocity"), 0.8);
    let end = seen.last().unwrap();
    assert_eq!((end.v[1], end.kp[1], end.kd[1], end.kp[0]), (0.8, 0.0, 8.0, 100.0));
    assert!((510..=513).contains(&end.time), "velocities stop when actions are stale: {}", end.time);
    let (_, seen) = run(&producer("[[0, 500]]", "[0.4]", 0.0), "action", &policy("effort"), 0.3);
    let end = seen.last().unwrap();
    assert_eq!((end.effort[1], end.kp[1], end.kd[1], end.effort[0]), (0.8, 0.0, 0.0, 0.0));
}

#[test]
fn invalid_configurations_are_refused_by_key() {
    let table = json!({ "rate": 50.0, "action": { "joints": ["joint1"], "default_pose": [0.0] } });
    let refuse = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut config = json!({ "policy": table });
        change(&mut config);
        let error = support::refusal::<JointTargetsPolicy>(config, Some("planar-3r"), Path::new("."));
        (error.key.unwrap_or_default(), error.message)
    };
    let (key, message) = refuse(&|config| config["policy"]["action"]["joints"] = json!(["joint9"]));
    assert_eq!((&key[..], &message[..]), ("policy", "robot `arm` has no joint \"joint9\""));
    let (key, message) = refuse(&|config| config["policy"]["action"]["default_pose"] = json!([]));
    assert_eq!(key, "policy.action.default_pose");
    assert!(message.starts_with("found 0 numbers, expected 1"), "{message}");
    let (key, _) = refuse(&|config| config["hold"] = json!("10 ms"));
    assert_eq!(key, "hold");
    let (key, _) = refuse(&|config| config["policy"]["rate"] = json!(0.0));
    assert_eq!(key, "policy");
    let (key, message) = refuse(&|config| config["policy"] = json!("no/such/folder"));
    assert!(key == "policy" && message.contains("no/such/folder/policy.toml"), "{message}");
    let (key, _) = refuse(&|config| {
        config["policy"]["action"]["kind"] = json!("effort");
        config["when_stale"] = json!("hold");
    });
    assert_eq!(key, "when_stale");
}

#[test]
fn robot_without_gains_requires_gains_in_the_policy() {
    let urdf = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/catalogue/planar-3r/planar-3r.urdf"),
    )
    .unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bare.urdf"), urdf).unwrap();
    let mut action = json!({ "joints": ["joint1"], "default_pose": [0.0] });
    let config = |action: &serde_json::Value| json!({ "policy": { "rate": 50.0, "action": action } });
    let error = support::refusal::<JointTargetsPolicy>(config(&action), Some("bare.urdf"), folder.path());
    assert_eq!(error.message, "robot `arm` has no profile with gains");
    assert!(error.advice.unwrap().contains("`action.kp`"));
    action["kp"] = json!(1.0);
    action["kd"] = json!(1.0);
    // the joints that the policy does not command are held
    let error = support::refusal::<JointTargetsPolicy>(config(&action), Some("bare.urdf"), folder.path());
    assert_eq!(error.message, "robot `arm` has no profile with gains");
}
