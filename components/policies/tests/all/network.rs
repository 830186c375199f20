//! `policy.network` in a running graph.

use std::path::Path;
use std::time::Duration;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, Placement, RobotReference, StepError};
use motorium::state::{Action, BaseState, ImuSample, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_learners::task::robot_digest;
use motorium_models::policy::{PolicyFolder, PolicyFolderError, RobotDigest};
use motorium_models::{inference::Unary, onnx};
use motorium_policies::{JointTargetsPolicy, NetworkPolicy};
use serde_json::json;

use crate::support;

/// A robot with known measurements that records the actions.
struct Robot {
    joints: Output<JointState>,
    base: Output<BaseState>,
    imu: Output<ImuSample>,
    action: Input<Action>,
    silent_from: u64,
    seen: Vec<(u64, Vec<f64>)>,
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
struct RobotConfig {
    /// ms
    silent_from: u64,
}

impl Component for Robot {
    const KIND: &'static str = "test.robot";
    const SUMMARY: &'static str = "publishes known measurements";
    type Config = RobotConfig;

    fn declare(_: &RobotConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointState>("joint_state", "measured joints");
        declare.output::<BaseState>("base_state", "base");
        declare.output::<ImuSample>("imu", "inertial measurement");
        declare.input::<Action>("action", "actions");
        Ok(())
    }

    fn configure(config: RobotConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            joints: setup.output("joint_state")?,
            base: setup.output("base_state")?,
            imu: setup.output("imu")?,
            action: setup.input("action")?,
            silent_from: config.silent_from,
            seen: Vec::new(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now = tick.time_ns / 1_000_000;
        if let Some(action) = self.action.next_unread() {
            assert_eq!(action.step as usize, self.seen.len());
            self.seen.push((now, action.value().to_vec()));
        }
        if now >= self.silent_from {
            return Ok(());
        }
        let mut state = self.joints.loan()?;
        state.set_count(3);
        state.position_mut().copy_from_slice(&[0.1, 0.2, 0.3]);
        state.velocity_mut().copy_from_slice(&[1.0, 2.0, 3.0]);
        state.effort_mut().fill(0.0);
        state.publish()?;
        let mut base = self.base.loan()?;
        *base = BaseState {
            orientation: [0.0, 0.0, 0.0, 1.0],
            linear_velocity: [0.7, 0.8, 0.9],
            ..BaseState::default()
        };
        base.publish()?;
        let mut imu = self.imu.loan()?;
        // rolled by a quarter turn: the left side is up
        let half = std::f64::consts::FRAC_1_SQRT_2;
        *imu = ImuSample {
            orientation: [half, 0.0, 0.0, half],
            angular_velocity: [0.4, 0.5, 0.6],
            ..ImuSample::default()
        };
        imu.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(self.seen))
    }
}

const TERMS: &str = r#"network = "policy.onnx"
rate = 50.0
observations = [
    { term = "base_linear_velocity" },
    { term = "base_angular_velocity", scale = 0.5 },
    { term = "projected_gravity" },
    { term = "command", scale = [1.0, 2.0, 3.0] },
    { term = "joint_positions" },
    { term = "joint_velocities", clip = [-1.5, 2.5], history = 2 },
    { term = "last_action" },
    { term = "phase", period = 0.08 },
]
[action]
joints = ["joint3", "joint1"]
default_pose = [0.25, 0.0]
clip = [-4.0, 4.0]
"#;

/// Number of inputs of the terms.
const INPUTS: usize = 3 + 3 + 3 + 3 + 2 + 2 * 2 + 2 + 2;

/// Writes a policy whose outputs are one input each.
fn write(folder: &Path, outputs: [usize; 2]) {
    let mut weights = vec![0.0; 2 * INPUTS];
    (0..2).for_each(|output| weights[output * INPUTS + outputs[output]] = 1.0);
    let network = onnx::write_mlp(INPUTS, &[(weights, vec![0.0, 0.0])], Unary::Relu, &[]);
    std::fs::write(folder.join("policy.onnx"), network).unwrap();
    std::fs::write(folder.join("policy.toml"), TERMS).unwrap();
}

/// Runs a policy whose outputs are one input each.
fn run(
    outputs: [usize; 2],
    config: &str,
    silent_from: u64,
) -> (motorium::launcher::Report, Vec<(u64, Vec<f64>)>) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), outputs);
    let imu = if config.contains("attitude") { "" } else { ", imu = \"arm/imu\"" };
    let graph = format!(
        r#"
name = "network"
clock = "lockstep"
duration = "400 ms"

[robot.arm]
urdf = "planar-3r"

[component.robot]
kind = "test.robot"
rate = "1 kHz"
subscribe = {{ action = "arm/action" }}
publish = {{ joint_state = "arm/joint_state", base_state = "arm/base_state", imu = "arm/imu" }}
config = {{ silent_from = {silent_from} }}

[component.policy]
kind = "policy.network"
robot = "arm"
rate = "50 Hz"
subscribe = {{ joint_state = "arm/joint_state", base_state = "arm/base_state"{imu} }}
publish = {{ action = "arm/action" }}

[component.policy.config]
policy = "."
{config}
"#
    );
    let kinds = [Kind::of::<Robot>(), Kind::of::<NetworkPolicy>()];
    let report = support::run(&folder.path().join("graph.toml"), graph, kinds);
    assert_eq!(support::faults(&report), (Some(0), 0), "it neither allocates nor fails");
    let seen = serde_json::from_value(report.results["robot"].clone()).unwrap();
    (report, seen)
}

fn first(outputs: [usize; 2], config: &str) -> Vec<f64> {
    run(outputs, config, 1000).1.remove(0).1
}

#[test]
fn observation_terms_come_from_their_topics() {
    let config = "command = [0.1, 0.2, 0.3]";
    let close = |found: Vec<f64>, expected: [f64; 2]| {
        assert!(
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6),
            "{found:?} {expected:?}"
        );
    };
    close(first([0, 2], config), [0.7, 0.9]);
    close(first([3, 5], config), [0.2, 0.3]);
    // gravity points to the right of a base that is rolled to the right
    close(first([7, 8], config), [-1.0, 0.0]);
    close(first([10, 11], config), [0.4, 0.9]);
    // joints in the order of the policy, from its default pose; velocities within bounds, the history full
    close(first([12, 13], config), [0.05, 0.1]);
    close(first([14, 15], config), [2.5, 1.0]);
    close(first([16, 17], config), [2.5, 1.0]);
    // the unit is mounted upside down
    close(first([7, 3], "imu_rpy = [3.141592653589793, 0.0, 0.0]"), [1.0, 0.2]);
    close(first([8, 3], "attitude = \"base_state\""), [-1.0, 0.0]);
}

#[test]
fn actions_are_periodic_and_bounded_and_see_the_last_one() {
    // the first output is the sine of the phase, a cycle in four steps; the second output sees the first of
    // the previous step
    let (report, seen) = run([20, 18], "", 1000);
    assert!((19..=20).contains(&seen.len()), "{}", seen.len());
    for (step, (time, action)) in seen.iter().enumerate() {
        let sine = [0.0, 1.0, 0.0, -1.0];
        assert!((action[0] - sine[step % 4]).abs() < 1e-6, "{step}: {action:?}");
        assert!(
            (action[1] - if step > 0 { sine[(step - 1) % 4] } else { 0.0 }).abs() < 1e-6,
            "{step}: {action:?}"
        );
        assert!(step == 0 || time - seen[step - 1].0 == 20, "{time}");
    }
    assert_eq!(report.results["policy"]["actions"], seen.len());
}

#[test]
fn old_measurements_produce_no_actions() {
    let (report, seen) = run([0, 1], "state_timeout = \"50 ms\"", 200);
    let last = seen.last().unwrap().0;
    assert!((220..=250).contains(&last), "{last}");
    assert!(report.results["policy"]["steps_without_measurements"].as_u64().unwrap() >= 6);
}

#[test]
fn a_missing_policy_is_refused_with_its_file() {
    let config = json!({ "policy": "nowhere" });
    let error = support::refusal::<NetworkPolicy>(config, Some("planar-3r"), Path::new("."));
    assert_eq!(error.key.as_deref(), Some("policy"));
    let expected = PolicyFolder::read(Path::new("./nowhere")).unwrap_err();
    assert!(
        matches!(&expected, PolicyFolderError::Read { path, .. } if path.ends_with("nowhere/policy.toml"))
    );
    assert_eq!(error.message, expected.to_string());
    assert!(error.advice.is_some());
}

#[test]
fn points_on_objects_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), [0, 1]);
    let point = "{ term = \"point_position\", points = [\"ball\", \"link3\"] }";
    let terms = TERMS.replace("{ term = \"base_linear_velocity\" }", point);
    std::fs::write(folder.path().join("policy.toml"), terms).unwrap();
    let error = support::refusal::<NetworkPolicy>(
        json!({ "policy": folder.path() }),
        Some("planar-3r"),
        folder.path(),
    );
    assert_eq!(error.key.as_deref(), Some("policy"));
    let expected = "\"ball\" is not a link of the robot, and no topic has the motion of objects";
    assert_eq!(error.message, expected);
}

#[test]
fn robots_are_compared_with_the_digest() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), [0, 1]);
    let loaded = motorium_robots::load("planar-3r", Path::new(".")).unwrap();
    let digest = robot_digest(&loaded, &["joint3", "joint1"]).unwrap();
    let declared = |RobotDigest { joints, dynamics }: RobotDigest| {
        let digest = format!("[robot_digest]\njoints = \"{joints:016x}\"\ndynamics = \"{dynamics:016x}\"\n");
        std::fs::write(folder.path().join("policy.toml"), format!("{TERMS}{digest}")).unwrap();
        let robot = RobotReference {
            name: "arm".into(),
            urdf: "planar-3r".into(),
            base: folder.path().into(),
            ..RobotReference::default()
        };
        let placement = Placement { folder: folder.path().into(), ..Placement::default() };
        let mut declare = Declare::new(Some(robot)).placed(placement);
        let config = serde_json::from_value(json!({ "policy": "." })).unwrap();
        NetworkPolicy::declare(&config, &mut declare).map(|()| declare.into_declaration().warnings.len())
    };
    assert_eq!(declared(digest).unwrap(), 0);
    assert_eq!(declared(RobotDigest { dynamics: 1, ..digest }).unwrap(), 1, "a warning");
    let error = declared(RobotDigest { joints: 1, ..digest }).unwrap_err();
    assert_eq!(error.key.as_deref(), Some("policy"));
    assert!(error.advice.is_some());
}

#[test]
fn joint_targets_of_a_pattern_have_no_limits() {
    const PATTERN: &str = r#"
[pattern]
gait = "GAIT"
frequency = [1.0, 2.0]
amplitude = [0.0, 1.0]
legs = [[{ joint = "joint1", amplitude = 0.1 }], [{ joint = "joint3", amplitude = 0.1 }]]
"#;
    let folder = tempfile::tempdir().unwrap();
    let key = |gait: &str, config: serde_json::Value| {
        let text = format!("{TERMS}{}", PATTERN.replace("GAIT", gait));
        std::fs::write(folder.path().join("policy.toml"), text).unwrap();
        support::refusal::<JointTargetsPolicy>(config, Some("planar-3r"), folder.path()).key.unwrap()
    };
    assert_eq!(key("walk", json!({ "policy": folder.path(), "interpolate": true })), "interpolate");
    assert_eq!(key("walk", json!({ "policy": folder.path(), "limits": {} })), "limits");
    assert_eq!(key("trot", json!({ "policy": folder.path() })), "policy", "two legs do not trot");
}

#[test]
fn a_policy_at_another_rate_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), [0, 1]);
    let robot = RobotReference {
        name: "arm".into(),
        urdf: "planar-3r".into(),
        base: folder.path().into(),
        ..RobotReference::default()
    };
    let config = serde_json::from_value(json!({ "policy": "." })).unwrap();
    let declared = |period: Duration| {
        let placement =
            Placement { period: Some(period), folder: folder.path().into(), ..Placement::default() };
        NetworkPolicy::declare(&config, &mut Declare::new(Some(robot.clone())).placed(placement))
    };
    declared(Duration::from_millis(20)).unwrap();
    let error = declared(Duration::from_millis(10)).unwrap_err();
    assert_eq!(error.message, "the component runs at 100 Hz, but the policy was trained for 50 Hz");
}
