//! `sensor.joint_encoder` in a running graph.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, Direction, RobotReference, StepError};
use motorium::launcher::{self, Hosting, Options, Report};
use motorium::state::JointState;
use motorium::transport::{Input, Output};
use motorium::worker::{ConfigSource, Kind, Registry, RobotSource};
use motorium_sensors::JointEncoder;

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// The true joint state: at tick k the position is k thousandths, until tick 50 or for ever.
struct Truth {
    state: Output<JointState>,
    forever: bool,
}

impl Component for Truth {
    const KIND: &'static str = "test.truth";
    const SUMMARY: &'static str = "a joint that moves steadily";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointState>("joint_state", "the truth");
        declare.boolean("forever", false, "whether it goes on after tick 50");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { state: setup.output("joint_state")?, forever: setup.parameter::<bool>("forever")?.get() })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.forever && tick.index >= 50 {
            return Ok(());
        }
        let mut state = self.state.loan()?;
        state.set_count(1);
        state.position_mut()[0] = tick.index as f64 * 1e-3;
        state.velocity_mut()[0] = 1.0;
        state.effort_mut()[0] = 2.0;
        state.publish()
    }
}

/// Writes down every measured state, with the tick at which it first saw it.
struct Recorder {
    measured: Input<JointState>,
    last: u64,
    seen: Vec<(u64, f64, f64, f64)>,
}

impl Component for Recorder {
    const KIND: &'static str = "test.recorder";
    const SUMMARY: &'static str = "writes down joint states";
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("measured", "what is measured");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { measured: setup.input("measured")?, last: 0, seen: Vec::new() })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(state) = self.measured.latest() else { return Ok(()) };
        if state.stamp().sequence != self.last {
            self.last = state.stamp().sequence;
            self.seen.push((tick.index, state.position()[0], state.velocity()[0], state.effort()[0]));
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!(self.seen))
    }
}

fn registry() -> Registry {
    Registry::new(
        RobotSource { check: |_, _| Ok(Vec::new()) },
        [Kind::of::<Truth>(), Kind::of::<JointEncoder>(), Kind::of::<Recorder>()],
    )
}

fn run(config: &str) -> Report {
    run_for("100 ms", config)
}

fn run_for(duration: &str, config: &str) -> Report {
    let graph = format!(
        r#"
name = "encoder"
clock = "lockstep"
duration = "{duration}"

[robot.rod]
urdf = "pendulum"

[component.truth]
kind = "test.truth"
rate = "1 kHz"
publish = {{ joint_state = "rod/true_state" }}
params = {{ forever = {} }}

[component.encoder]
kind = "sensor.joint_encoder"
robot = "rod"
rate = "1 kHz"
subscribe = {{ joint_state = "rod/true_state" }}
publish = {{ measured = "rod/joint_state" }}
config = {{ {config} }}

[component.recorder]
kind = "test.recorder"
rate = "1 kHz"
subscribe = {{ measured = "rod/joint_state" }}
"#,
        duration != "100 ms"
    );
    let path = std::path::Path::new("encoder.toml");
    let machine = motorium::graph::Machine::detect();
    let checked = motorium::graph::check(path, graph, &[], &registry(), &machine)
        .unwrap_or_else(|error| panic!("{error}"));
    let options = Options { hosting: Hosting::OneProcess, program: std::env::current_exe().unwrap() };
    launcher::run(checked.plan, &registry(), &options, &mut |_| {}).unwrap()
}

fn seen(report: &Report) -> Vec<(u64, f64, f64, f64)> {
    serde_json::from_value(report.results["recorder"].clone()).unwrap()
}

#[test]
fn readings_come_late_by_the_latency_and_stop_with_the_truth() {
    let prompt = seen(&run(""));
    let late = seen(&run(r#"latency = "7 ms""#));
    assert_eq!((prompt.len(), late.len()), (50, 50));
    for (prompt, late) in prompt.iter().zip(&late) {
        assert_eq!(late.0, prompt.0 + 7);
        assert_eq!((late.1, late.2, late.3), (prompt.1, 1.0, 2.0));
    }
}

#[test]
fn readings_are_quantised_and_noisy_as_configured_and_the_same_in_every_run() {
    let config = "resolution = 0.01, velocity_noise = [0.5], effort_noise = 0.1, seed = 4";
    let (one, two) = (run(config), run(config));
    assert_eq!(one.state_hash, two.state_hash);
    let readings = seen(&one);
    assert!(readings.iter().all(|reading| (reading.1 * 100.0 - (reading.1 * 100.0).round()).abs() < 1e-9));
    assert!(readings.iter().any(|reading| (reading.2 - 1.0).abs() > 0.1));
    assert!(readings.iter().all(|reading| reading.3 != 2.0));
    assert_eq!(one.results["encoder"], serde_json::json!({ "readings": 50, "lost": 0 }));
    assert_ne!(run(&config.replace("seed = 4", "seed = 5")).state_hash, one.state_hash);
}

#[test]
fn a_step_allocates_nothing() {
    let report = run_for("1 s", r#"resolution = 0.001, position_noise = 0.001, latency = "3 ms""#);
    let encoder = report.components.iter().find(|component| component.name == "encoder").unwrap();
    assert_eq!((encoder.steps, encoder.allocations, encoder.errors), (1000, Some(0), 0));
}

fn declare(config: serde_json::Value, robot: bool) -> Result<Vec<String>, (Option<String>, String)> {
    let robot =
        robot.then(|| RobotReference { name: "rod".into(), urdf: "pendulum".into(), base: ".".into() });
    Kind::of::<JointEncoder>()
        .declare(ConfigSource::Json(config), robot)
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
fn it_declares_a_true_and_a_measured_joint_state() {
    assert_eq!(declare(serde_json::json!({}), true).unwrap(), ["in joint_state", "out measured"]);
}

#[test]
fn configurations_that_cannot_be_are_refused_with_their_key() {
    let refuse = |config| declare(config, true).unwrap_err();
    let (key, message) = refuse(serde_json::json!({ "resolution": [0.1, 0.1] }));
    assert_eq!(key.as_deref(), Some("resolution"));
    assert!(message.starts_with("resolution lists 2 numbers, the robot has 1 joints"), "{message}");
    let (key, _) = refuse(serde_json::json!({ "position_noise": -1.0 }));
    assert_eq!(key.as_deref(), Some("position_noise"));
    let (_, message) = refuse(serde_json::json!({ "latency": "5" }));
    assert!(message.contains("without a unit"), "{message}");
    let (_, message) = refuse(serde_json::json!({ "latncy": "5 ms" }));
    assert!(message.contains("latncy"), "{message}");
    let (_, message) = declare(serde_json::json!({}), false).unwrap_err();
    assert_eq!(message, "an encoder has the joints of a robot, and there is none");
}
