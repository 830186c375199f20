//! `sensor.joint_encoder` in a running graph.

use motorium::declare::{Direction, RobotReference};
use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, Source, machine};
use motorium::worker::Kind;
use motorium_sensors::JointEncoder;

/// Returns a graph with an encoder that has this `config` table and a probe of its readings, both after
/// `truth`.
fn graph(truth: Source, config: &str) -> (Graph, Probe<JointState>) {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    let encoder = Instance::of::<JointEncoder>("encoder")
        .rate("1 kHz")
        .robot("rod")
        .subscribe("joint_state", "rod/true_state")
        .publish("measured", "rod/joint_state")
        .set("config", config["config"].clone());
    let readings = Probe::for_topic("rod/joint_state");
    (Graph::new("encoder").robot("rod", "pendulum").with(truth).with(encoder).with(&readings), readings)
}

/// The true joint state: at tick k the position is k thousandths. It ends at tick `end`.
fn truth(end: u64) -> Source {
    Source::new("truth", "rod/true_state", move |tick| {
        (tick.index < end).then(|| joint_state(tick.index as f64 * 1e-3))
    })
}

fn joint_state(position: f64) -> JointState {
    let mut state = JointState::default();
    state.set_count(1);
    state.position_mut()[0] = position;
    state.velocity_mut()[0] = 1.0;
    state.effort_mut()[0] = 2.0;
    state
}

/// Runs for 100 ms with a truth of 50 ms. Returns for each reading the tick at which it was seen, position,
/// velocity and effort.
fn run(config: &str) -> (Report, Vec<(u64, f64, f64, f64)>) {
    let (graph, probe) = graph(truth(50), config);
    let report = graph.run("100 ms").unwrap();
    let readings = probe.samples().into_iter().map(|sample| {
        let state = sample.value;
        (sample.tick.index, state.position()[0], state.velocity()[0], state.effort()[0])
    });
    (report, readings.collect())
}

#[test]
fn readings_are_delayed_and_stop_with_the_truth() {
    let prompt = run("").1;
    let late = run(r#"latency = "7 ms""#).1;
    assert_eq!((prompt.len(), late.len()), (50, 50));
    for (prompt, late) in prompt.iter().zip(&late) {
        assert_eq!(late.0, prompt.0 + 7);
        assert_eq!((late.1, late.2, late.3), (prompt.1, 1.0, 2.0));
    }
}

#[test]
fn readings_are_quantised_noisy_and_reproducible() {
    let config =
        "position = { resolution = 0.01 }, velocity = { noise = [0.5] }, effort = { noise = 0.1 }, seed = 4";
    let ((one, readings), (two, _)) = (run(config), run(config));
    assert_eq!(one.state_hash, two.state_hash);
    assert!(readings.iter().all(|reading| (reading.1 * 100.0 - (reading.1 * 100.0).round()).abs() < 1e-9));
    assert!(readings.iter().any(|reading| (reading.2 - 1.0).abs() > 0.1));
    assert!(readings.iter().all(|reading| reading.3 != 2.0));
    assert_eq!(one.results["encoder"], serde_json::json!({ "readings": 50, "dropped": 0, "lost": 0 }));
    assert_ne!(run(&config.replace("seed = 4", "seed = 5")).0.state_hash, one.state_hash);
}

#[test]
fn step_does_not_allocate() {
    let (graph, _) = graph(
        truth(1000),
        r#"position = { resolution = 0.001, noise = 0.001, bias_walk = 0.1 }, latency = "3 ms", drop_out = 0.1"#,
    );
    let report = graph.run("1 s").unwrap();
    let encoder = report.components.iter().find(|component| component.name == "encoder").unwrap();
    assert_eq!((encoder.steps, encoder.allocations, encoder.errors), (1000, Some(0), 0));
}

/// The position equals the run time of the step that computed it, so the true velocity is 1 rad/s.
#[test]
fn differentiated_velocity_ignores_publication_jitter() {
    let truth = Source::new("truth", "rod/true_state", |tick| Some(joint_state(tick.time())));
    let (graph, readings) = graph(truth, "differentiate = { cutoff_hz = 1e6 }");
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let report = graph.set("clock", "realtime").run("300 ms").unwrap();
    let readings = readings.values();
    assert!(readings.len() > 10, "{} readings: {report:?}", readings.len());
    for reading in &readings[1..] {
        assert!((reading.velocity()[0] - 1.0).abs() < 1e-6, "{} rad/s", reading.velocity()[0]);
    }
}

fn declare(config: serde_json::Value, robot: bool) -> Result<Vec<String>, (Option<String>, String)> {
    let robot = robot.then(|| RobotReference {
        name: "rod".into(),
        urdf: "pendulum".into(),
        base: ".".into(),
        ..RobotReference::default()
    });
    Kind::of::<JointEncoder>()
        .declare(config, robot)
        .map(|declaration| {
            let port = |direction| match direction {
                Direction::Input => "in",
                Direction::Output => "out",
            };
            declaration.ports.iter().map(|p| format!("{} {}", port(p.direction), p.name)).collect()
        })
        .map_err(|problem| (problem.error.key, problem.error.message))
}

#[test]
fn declares_true_and_measured_joint_states() {
    assert_eq!(declare(serde_json::json!({}), true).unwrap(), ["in joint_state", "out measured"]);
}

#[test]
fn invalid_configurations_are_rejected_with_their_key() {
    let refuse = |config| declare(config, true).unwrap_err();
    let (key, message) = refuse(serde_json::json!({ "position": { "resolution": [0.1, 0.1] } }));
    assert_eq!(key.as_deref(), Some("position.resolution"));
    assert!(
        message.starts_with("position.resolution lists 2 numbers, but the robot has 1 joints"),
        "{message}"
    );
    let (key, _) = refuse(serde_json::json!({ "position": { "noise": -1.0 } }));
    assert_eq!(key.as_deref(), Some("position.noise"));
    let (_, message) = refuse(serde_json::json!({ "latency": "5" }));
    assert!(message.contains("without a unit"), "{message}");
    let (_, message) = refuse(serde_json::json!({ "latncy": "5 ms" }));
    assert!(message.contains("latncy"), "{message}");
    let (_, message) = declare(serde_json::json!({}), false).unwrap_err();
    assert_eq!(message, "the component needs the joints of a robot, but names no robot");
}

#[test]
fn reading_keeps_the_source_time_of_its_state() {
    let (graph, probe) = graph(truth(1000), r#"latency = "7 ms""#);
    graph.run("100 ms").unwrap();
    let samples = probe.samples();
    assert_eq!(samples.len(), 93);
    for sample in samples {
        assert_eq!(sample.stamp.publish_time - sample.stamp.source_time, 7_000_000);
        let tick = sample.stamp.source_time / 1_000_000;
        assert_eq!(sample.value.position()[0], tick as f64 * 1e-3);
    }
}
