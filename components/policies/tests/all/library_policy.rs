//! `policy.library` in a running graph.

use crate::support::{self, Nothing};

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::launcher::Report;
use motorium::state::{JointState, PoseTarget};
use motorium::telemetry::{allocations, counts_allocations};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_library::{
    DAMPING, Generator, Metric, MotionLibrary, Movement, Recogniser, Recordings, SampledSpring,
    Superposition, Trajectory, Truncation, file,
};
use motorium_policies::LibraryPolicy;
use motorium_policies::library::{MovementRequest, Recognition};
use nalgebra::DMatrix;

/// A robot that is always at its setpoint, and requests another movement after a while.
struct Follower {
    setpoint: Input<JointState>,
    recognised: Input<Recognition>,
    state: Output<JointState>,
    request: Output<MovementRequest>,
    q: Vec<f64>,
    largest_step: f64,
    seen: Vec<(u64, f64)>,
    /// The first two joints, step by step.
    path: Vec<[f64; 2]>,
}

impl Component for Follower {
    const KIND: &'static str = "test.follower";
    const SUMMARY: &'static str = "a robot that is always at its setpoint";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("setpoint", "commanded joint positions");
        declare.input::<Recognition>("recognised", "the recognised movement");
        declare.output::<JointState>("joint_state", "joint positions");
        declare.output::<MovementRequest>("request", "another movement");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            setpoint: setup.input("setpoint")?,
            recognised: setup.input("recognised")?,
            state: setup.output("joint_state")?,
            request: setup.output("request")?,
            q: vec![0.1; 3],
            largest_step: 0.0,
            seen: Vec::new(),
            path: Vec::new(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if let Some(setpoint) = self.setpoint.latest() {
            for (q, y) in self.q.iter_mut().zip(setpoint.position()) {
                self.largest_step = self.largest_step.max((*q - y).abs());
                *q = *y;
            }
        }
        if let Some(seen) = self.recognised.latest()
            && self.seen.last().is_none_or(|last| last.0 != seen.sequence * 100 + seen.movement)
        {
            self.seen.push((seen.sequence * 100 + seen.movement, seen.novelty));
        }
        if tick.index == 500 {
            let mut label = [0; 32];
            label[..5].copy_from_slice(b"there");
            let mut request = self.request.loan()?;
            *request = MovementRequest { sequence: 1, label, ..MovementRequest::default() };
            request.publish()?;
        }
        self.path.push([self.q[0], self.q[1]]);
        let mut state = self.state.loan()?;
        state.set_count(3);
        state.position_mut().copy_from_slice(&self.q);
        state.velocity_mut().fill(0.0);
        state.effort_mut().fill(0.0);
        state.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(
            serde_json::json!({ "largest_step": self.largest_step, "seen": self.seen, "q": self.q, "path": self.path }),
        )
    }
}

/// A library of two movements of the planar arm: joints out and back.
fn library() -> MotionLibrary {
    let movement = |id: &str, far: [f64; 3], bow: f64| {
        let path = DMatrix::from_fn(100, 3, |k, d| {
            let t = k as f64 / 99.0;
            let s = t * t * t * (10.0 + t * (6.0 * t - 15.0));
            far[d] * s + bow * (d as f64 - 1.0) * (std::f64::consts::PI * s).sin()
        });
        Trajectory { id: id.into(), label: Some(id.into()), duration: 1.0, positions: path }
    };
    let robot = motorium_robots::load("planar-3r", std::path::Path::new(".")).unwrap();
    let names = robot.model.joint_names().to_vec();
    let trajectories = vec![
        movement("here", [0.5, -0.3, 0.4], 0.3),
        movement("there", [-0.4, 0.6, 0.1], -0.2),
        movement("back", [0.1, 0.1, -0.5], 0.1),
    ];
    let spring = SampledSpring::new(100, DAMPING).unwrap();
    MotionLibrary::build(&Recordings { names, trajectories }, spring, Metric::Position, Truncation::All)
        .unwrap()
}

fn run(config: &str, request: bool) -> Report {
    let folder = tempfile::tempdir().unwrap();
    file::write(&library(), &folder.path().join("arm.library")).unwrap();
    run_in(folder.path(), &format!("library = \"arm.library\"\n{config}"), request)
}

pub(crate) fn run_in(folder: &std::path::Path, config: &str, request: bool) -> Report {
    let wire = if request { ", request = \"arm/request\"" } else { "" };
    let graph = format!(
        r#"
name = "library"
clock = "lockstep"
duration = "8 s"

[robot.arm]
urdf = "planar-3r"

[component.robot]
kind = "test.follower"
rate = "1 kHz"
subscribe = {{ setpoint = "arm/setpoint", recognised = "arm/recognised" }}
publish = {{ joint_state = "arm/joint_state", request = "arm/request" }}

[component.policy]
kind = "policy.library"
robot = "arm"
rate = "1 kHz"
subscribe = {{ joint_state = "arm/joint_state"{wire} }}
publish = {{ setpoint = "arm/setpoint", recognised = "arm/recognised" }}

[component.policy.config]
{config}
"#
    );
    let kinds = [Kind::of::<Follower>(), Kind::of::<LibraryPolicy>()];
    support::run(&folder.join("library.toml"), graph, kinds)
}

#[test]
fn movements_are_continuous_and_are_recognised() {
    let report = run("movements = [\"here\", \"there\"]", false);
    let (robot, policy) = (&report.results["robot"], &report.results["policy"]);
    assert!(robot["largest_step"].as_f64().unwrap() < 0.01, "{robot}");
    assert_eq!(policy["movements_begun"], 2);
    assert_eq!(policy["finished"], true);
    for movement in policy["movements"].as_array().unwrap() {
        assert!(movement["path_error"].as_f64().unwrap() < 0.01, "{movement}");
    }
    let labels: Vec<&str> =
        policy["recognised"].as_array().unwrap().iter().map(|seen| seen["label"].as_str().unwrap()).collect();
    assert!(labels.contains(&"here") && labels.contains(&"there"), "{policy}");
    assert!(!robot["seen"].as_array().unwrap().is_empty(), "recognised movements must be published");
    assert_eq!(support::faults(&report), (Some(0), 0), "a step allocates or fails");
}

#[test]
fn requested_movement_follows_the_current_one() {
    let report = run("movements = [\"here\"]", true);
    let (robot, policy) = (&report.results["robot"], &report.results["policy"]);
    assert_eq!(policy["movements_begun"], 2, "{policy}");
    // the goal of `there`
    let q: Vec<f64> = robot["q"].as_array().unwrap().iter().map(|q| q.as_f64().unwrap()).collect();
    assert!(q.iter().zip([-0.4, 0.6, 0.1]).all(|(a, b)| (a - b).abs() < 0.02), "{q:?}");
    assert!(robot["largest_step"].as_f64().unwrap() < 0.01, "{robot}");
}

#[test]
fn fewer_eigenforces_are_reported_as_less_exact() {
    let report = run("movements = [\"here\"]\neigenforces = [1, 3]", false);
    let errors = &report.results["policy"]["path_error_by_eigenforces"];
    let error = |n: &str| errors[n].as_f64().unwrap();
    assert!(error("1") > 0.01 && error("3") < 1e-3, "{errors}");
}

fn refuse(config: serde_json::Value) -> (String, Option<String>) {
    let here = std::env::current_dir().unwrap();
    let error = support::refusal::<LibraryPolicy>(config, Some("panda"), &here);
    (error.to_string(), error.key)
}

#[test]
fn invalid_configurations_are_refused_by_key() {
    let (message, key) = refuse(serde_json::json!({ "library": "none.library", "movements": ["a"] }));
    assert!(key.as_deref() == Some("library") && message.contains("none.library"), "{message}");
    let end_effector = serde_json::json!({ "origin": [0.4, 0.0, 0.4] });
    let (message, key) = refuse(
        serde_json::json!({ "library": "letters", "movements": ["a", "?"], "end_effector": end_effector }),
    );
    assert!(key.as_deref() == Some("movements[1]") && message.contains('?'), "{message}");
    let (_, key) = refuse(
        serde_json::json!({ "library": "letters", "movements": ["a"], "eigenforces": [0], "end_effector": end_effector }),
    );
    assert_eq!(key.as_deref(), Some("eigenforces"));
    let (message, key) = refuse(serde_json::json!({ "library": "letters", "movements": ["a"] }));
    assert!(key.as_deref() == Some("library") && message.contains("not a joint"), "{message}");
}

#[test]
fn recognition_and_generation_never_allocate() {
    let library = library();
    let movement = Movement::from_trajectory(
        &Trajectory {
            id: String::new(),
            label: None,
            duration: 1.0,
            positions: Superposition::from_entry(&library, 0, 3).path(&library),
        },
        library.spring(),
    );
    let mut recogniser = Recogniser::new(&library, 3);
    let mut generator = Generator::new(&library);
    let known = Superposition::from_entry(&library, 1, 3);
    let goal = known.frame.goal.clone();
    assert!(counts_allocations());
    let before = allocations().own;
    let novelty = recogniser.novelty(&movement.forces);
    let nearest = recogniser.nearest();
    generator.start(&known.weights, &known.frame).unwrap();
    for k in 0..1500 {
        generator.step(1e-3);
        if k == 300 {
            generator.set_goal(&goal).unwrap();
        }
    }
    assert_eq!(allocations().own, before);
    assert!(novelty < 1e-6 && nearest.is_some_and(|(k, _)| k == 0));
}

/// Recorded velocities of the joints, as of a pen: the library is learned from them when the run starts.
#[test]
fn movements_are_learned_directly_from_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let library = library();
    let mut lines = String::new();
    for (k, entry) in library.entries().iter().enumerate() {
        let path = Superposition::from_entry(&library, k, library.rank()).path(&library);
        let velocity = |d: usize| {
            (0..path.nrows())
                .map(|i| (path[(i, d)] - if i > 0 { path[(i - 1, d)] } else { 0.0 }) * 100.0)
                .collect()
        };
        let [a, b, c]: [Vec<f64>; 3] = [velocity(0), velocity(1), velocity(2)];
        let line = serde_json::json!({ "label": entry.label, "vjoint1": a, "vjoint2": b, "vjoint3": c });
        lines += &format!("{line}\n");
    }
    std::fs::write(folder.path().join("recorded.jsonl"), lines).unwrap();
    let config = "library = \"recorded.jsonl\"\nrate = 100.0\nmovements = [\"there\"]\neigenforces = [1, 3]\nduration = \"1 s\"";
    let report = run_in(folder.path(), config, false);
    let policy = &report.results["policy"];
    assert_eq!((&policy["movements_begun"], &policy["finished"]), (&2.into(), &true.into()));
    let error = |n: &str| policy["path_error_by_eigenforces"][n].as_f64().unwrap();
    assert!(error("1") > 0.01 && error("3") < 1e-3, "{policy}");
    let q: Vec<f64> = serde_json::from_value(report.results["robot"]["q"].clone()).unwrap();
    for (found, expected) in q.iter().zip([-0.4, 0.6, 0.1]) {
        assert!((found - expected).abs() < 0.01, "{q:?}");
    }
}

/// The target has the same type as in the other policies.
#[test]
fn hand_follows_pose_targets() {
    let robot = RobotReference {
        name: "panda".into(),
        urdf: "panda".into(),
        base: std::env::current_dir().unwrap(),
        ..RobotReference::default()
    };
    let config = serde_json::json!({ "library": "letters", "movements": ["a"], "end_effector": { "origin": [0.4, 0.0, 0.4] } });
    let declared = Kind::of::<LibraryPolicy>().declare(config, Some(robot)).unwrap();
    let target = declared.ports.iter().find(|port| port.name == "target").unwrap();
    assert_eq!(target.layout.type_name, <PoseTarget as motorium::state::StateBuffer>::NAME);
}
