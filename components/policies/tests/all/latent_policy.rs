//! `policy.latent` in a running graph, with joints that follow their commands.

use std::path::Path;

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::state::Observation;
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_models::gplvm::{BackForm, LatentModel, Settings, SpaceData};
use motorium_policies::LatentPolicy;

const START: [f64; 3] = [0.5, 0.8, 0.8];

/// The human's pose for two hidden causes.
fn human(u: f64, v: f64) -> [f64; 4] {
    [u, v, 0.5 * u - v, (u + v).tanh()]
}

/// The pose of each robot for them.
fn robots(u: f64, v: f64) -> [[f64; 3]; 2] {
    [[0.6 * u, 0.5 + 0.4 * v, 0.8 - 0.3 * u * v], [0.2 - 0.5 * v, 0.6 + 0.3 * u, 0.7 + 0.2 * (u - v)]]
}

/// Writes a model of a human and the robots `left` and `right`.
fn train(file: &Path, back: Option<BackForm>) {
    let causes: Vec<(f64, f64)> =
        (0..60).map(|i| ((0.37 * f64::from(i)).sin(), (0.53 * f64::from(i) + 1.0).sin())).collect();
    let people: Vec<f64> = causes.iter().flat_map(|(u, v)| human(*u, *v)).collect();
    let [left, right] =
        [0, 1].map(|i| causes.iter().flat_map(|(u, v)| robots(*u, *v)[i]).collect::<Vec<_>>());
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_string()).collect::<Vec<_>>();
    let joints = names(&["joint1", "joint2", "joint3"]);
    let data = [
        SpaceData { name: "human", columns: names(&["a", "b", "c", "d"]), values: &people },
        SpaceData { name: "left", columns: joints.clone(), values: &left },
        SpaceData { name: "right", columns: joints, values: &right },
    ];
    let back = back.map(|form| ("human".to_string(), form));
    let settings = Settings { latents: Some(4), back, iterations: 100, ..Settings::default() };
    LatentModel::train(&data, &settings).expect("a model").0.save(file).expect("written");
}

/// An arm that moves to its commanded positions immediately.
fn arm(name: &str) -> Function {
    let topic = |kind: &str| format!("{name}/{kind}");
    Function::new::<JointCommand, JointState>(name, &topic("command"), &topic("state"), |_, command| {
        let mut state = JointState::default();
        state.set_count(3);
        match command {
            Some(command) => state.position_mut().copy_from_slice(command.position()),
            None => state.position_mut().copy_from_slice(&START),
        }
        Some(state)
    })
}

/// A source of the human's pose, which stops at `until`, s.
fn person(pose: [f64; 4], until: f64) -> Source {
    Source::new::<Observation>("person", "pose", move |tick| {
        let mut observation = Observation::default();
        observation.set_count(4);
        observation.value_mut().copy_from_slice(&pose);
        (tick.time_ns as f64 * 1e-9 < until).then_some(observation)
    })
}

fn policy(config: &str, ports: bool) -> Instance {
    let config: toml::Table = format!("config = {config}").parse().expect("a table");
    let mut policy = Instance::of::<LatentPolicy>("policy").rate("1 kHz");
    if ports {
        policy = policy.subscribe("human", "pose");
    }
    for name in ["left", "right"] {
        policy = policy
            .subscribe(&format!("state_{name}"), &format!("{name}/state"))
            .publish(&format!("command_{name}"), &format!("{name}/command"));
    }
    policy
        .set("robots", vec![toml::Value::from("left"), toml::Value::from("right")])
        .set("config", config["config"].clone())
}

fn graph(folder: &Path, config: &str, ports: bool) -> Graph {
    Graph::new("latent-test")
        .at_path(&folder.join("graph.toml"))
        .robot("left", "planar-3r")
        .robot("right", "planar-3r")
        .with(arm("left"))
        .with(arm("right"))
        .with(policy(config, ports))
}

const GAINS: &str = "joint_command = { kp = 10.0, kd = 1.0, ease = \"200 ms\" }";

fn figure(report: &Report, robot: &str, key: &str) -> f64 {
    let figures = &report.results["policy"]["robots"][robot];
    figures[key].as_f64().unwrap_or_else(|| panic!("{key} of {figures}"))
}

/// Returns the last positions of both robots.
fn run(graph: Graph, time: &str) -> ([Vec<f64>; 2], Report) {
    let probes =
        ["left/command", "right/command"].map(|topic| Probe::<JointCommand>::for_topic(topic).triggered());
    let report = graph.with(&probes[0]).with(&probes[1]).run(time).expect("it runs");
    let policy = report.components.iter().find(|component| component.name == "policy").expect("the policy");
    assert_eq!((policy.allocations, policy.errors), (Some(0), 0), "a step allocates or fails");
    (probes.map(|probe| probe.values().last().expect("commands").position().to_vec()), report)
}

#[test]
fn robots_follow_poses_from_a_port_without_allocation() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    let config = format!("{{ model = \"arms.latent\", {GAINS} }}");
    let (u, v) = (0.35, -0.2);
    let graph = graph(folder.path(), &config, true).with(person(human(u, v), f64::INFINITY));
    let (last, report) = run(graph, "3 s");
    for (last, expected) in last.iter().zip(robots(u, v)) {
        assert!(last.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02), "{last:?} and {expected:?}");
    }
    assert!(figure(&report, "left", "largest_novelty") < 0.2, "{}", report.results["policy"]);
    assert_eq!(figure(&report, "left", "slowed_s"), 0.0);
}

#[test]
fn an_unfamiliar_pose_holds_the_robots() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    let config = format!("{{ model = \"arms.latent\", {GAINS} }}");
    let graph =
        graph(folder.path(), &config, true).with(person([900.0, -900.0, 900.0, 900.0], f64::INFINITY));
    let (last, report) = run(graph, "2 s");
    assert_eq!(last, [START.to_vec(), START.to_vec()]);
    assert!(figure(&report, "right", "largest_novelty") > 0.9, "{}", report.results["policy"]);
    assert!(figure(&report, "right", "held_s") > 1.9, "{}", report.results["policy"]);
}

#[test]
fn robots_hold_once_poses_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    let config = format!("{{ model = \"arms.latent\", {GAINS}, timeout = \"100 ms\" }}");
    let graph = graph(folder.path(), &config, true).with(person(human(0.1, 0.3), 1.0));
    let (_, report) = run(graph, "3 s");
    // the timeout plus the change of pace
    let held = figure(&report, "left", "held_s");
    assert!((1.6..1.75).contains(&held), "{held}");
}

#[test]
fn a_recorded_movement_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    let cause = |t: f64| ((0.8 * t).sin(), 0.5 * (1.1 * t).sin());
    let mut text = "time_s,d,c,b,a\n".to_string();
    for i in 0..=60 {
        let t = 0.05 * f64::from(i);
        let [a, b, c, d] = human(cause(t).0, cause(t).1);
        text += &format!("{t},{d},{c},{b},{a}\n");
    }
    std::fs::write(folder.path().join("take.csv"), text).expect("written");
    let config = format!("{{ model = \"arms.latent\", motion = \"take.csv\", {GAINS} }}");
    let (last, report) = run(graph(folder.path(), &config, false), "5 s");
    let (u, v) = cause(3.0);
    for (last, expected) in last.iter().zip(robots(u, v)) {
        assert!(last.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02), "{last:?} and {expected:?}");
    }
    assert!(figure(&report, "right", "tracking_error") < 0.05, "{}", report.results["policy"]);
}

const LIMITED: &str = r#"
title = "Planar arm that accelerates slowly"
sources = []
joints = ["joint1", "joint2", "joint3"]
home = "bent"
[poses]
bent = [0.5, 0.8, 0.8]
[limits]
acceleration = [8.0, 12.0, inf]
"#;

#[test]
fn setpoints_keep_the_acceleration_limits_of_the_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    std::fs::write(folder.path().join("limited.toml"), LIMITED).expect("written");
    let config = format!("{{ model = \"arms.latent\", {GAINS}, follow = \"10 ms\" }}");
    // the human jumps between poses, and finally stays at one
    let person = Source::new::<Observation>("person", "pose", |tick| {
        let side =
            if tick.time_ns < 2_000_000_000 && tick.time_ns / 250_000_000 % 2 == 1 { -1.0 } else { 1.0 };
        let mut observation = Observation::default();
        observation.set_count(4);
        observation.value_mut().copy_from_slice(&human(0.8 * side, -0.7 * side));
        Some(observation)
    });
    let probes =
        ["left/command", "right/command"].map(|topic| Probe::<JointCommand>::for_topic(topic).triggered());
    let graph = graph(folder.path(), &config, true).with(person).with(&probes[0]).with(&probes[1]);
    let report = graph.set("robot.left.profile", "limited.toml").run("4 s").expect("it runs");
    let policy = report.components.iter().find(|component| component.name == "policy").expect("the policy");
    assert_eq!((policy.allocations, policy.errors), (Some(0), 0), "a step allocates or fails");
    let [left, right] = probes.map(|probe| probe.values());
    // the largest change of the velocity of a joint, per second, and of its position beyond its velocity
    let hardest = |commands: &[JointCommand], joint: usize| {
        let pairs = commands.windows(2).map(|pair| {
            let velocity = pair[1].velocity()[joint];
            let moved = (pair[1].position()[joint] - pair[0].position()[joint]) * 1e3;
            ((velocity - pair[0].velocity()[joint]).abs() * 1e3, (moved - velocity).abs())
        });
        pairs.fold((0.0_f64, 0.0_f64), |worst, pair| (worst.0.max(pair.0), worst.1.max(pair.1)))
    };
    for (joint, limit) in [(0, 8.0), (1, 12.0)] {
        let (acceleration, difference) = hardest(&left, joint);
        assert!(acceleration <= 0.9 * limit + 1e-6, "joint {joint}: {acceleration}");
        assert!(acceleration > 0.89 * limit, "joint {joint} uses its limit: {acceleration}");
        assert!(difference < 1e-6, "joint {joint} moves as its velocity says: {difference} rad/s");
        assert!(hardest(&right, joint).0 > 3.0 * limit, "the other robot has no limits");
    }
    assert!(hardest(&left, 2).0 > 30.0, "the third joint has no limit");
    let last = left.last().expect("commands").position();
    assert!(last.iter().zip(robots(0.8, -0.7)[0]).all(|(a, b)| (a - b).abs() < 0.03), "{last:?}");
    assert!(figure(&report, "left", "limited_error") > 0.01, "{}", report.results["policy"]);
    assert_eq!(figure(&report, "right", "limited_error"), 0.0);
}

#[test]
fn invalid_configurations_are_refused_by_key() {
    let folder = tempfile::tempdir().expect("a folder");
    train(&folder.path().join("arms.latent"), Some(BackForm::Pose));
    train(&folder.path().join("free.latent"), None);
    std::fs::write(folder.path().join("take.csv"), "time_s,a,b\n0,1,2\n1,2,3\n").expect("written");
    for (config, expected) in [
        ("{ model = \"missing.latent\" }", "missing.latent"),
        ("{ model = \"free.latent\" }", "the latent points of the model are free"),
        ("{ model = \"arms.latent\", motion = \"take.csv\" }", "found no channel `c`"),
        ("{ model = \"arms.latent\", rate = 30.0 }", "requires a `motion`"),
        ("{ model = \"arms.latent\", spaces = { left = \"arm\" } }", "no space `arm`"),
        ("{ model = \"arms.latent\", spaces = { left = \"human\" } }", "is the human's"),
        ("{ model = \"arms.latent\", spaces = { middle = \"left\" } }", "no robot `middle`"),
        ("{ model = \"arms.latent\", follow = \"0 s\" }", "expected 1 ms to 10 s"),
        ("{ model = \"arms.latent\", timeout = \"0 s\" }", "expected more than 0 s"),
    ] {
        let error = graph(folder.path(), config, true).with(person([0.0; 4], 1.0));
        let error = error.check().expect_err("it is refused").render(false);
        assert!(error.contains(expected), "no `{expected}` in\n{error}");
    }
}
