//! `policy.dmp` with a demonstration, and with primitives that change while it runs.

use crate::support::{self, Nothing};

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::launcher::Report;
use motorium::state::PoseTarget;
use motorium::transport::Input;
use motorium::worker::Kind;
use motorium_policies::DmpPolicy;
use motorium_primitives::dmp::{Demonstration, DmpModel, Regression, Settings};
use motorium_primitives::file::{Primitive, PrimitiveFile};
use nalgebra::DMatrix;
use serde_json::json;

/// Records every target.
struct Recorder {
    target: Input<PoseTarget>,
    seen: Vec<[f64; 3]>,
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

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        if let Some(target) = self.target.latest() {
            self.seen.push(target.position);
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(self.seen))
    }
}

fn run(config: &str, wiring: &str) -> (Report, Vec<[f64; 3]>) {
    let graph = format!(
        r#"
name = "imitate"
clock = "lockstep"
duration = "5 s"

[component.policy]
kind = "policy.dmp"
rate = "1 kHz"
publish = {{ target = "arm/target" }}
{wiring}

[component.policy.config]
start = {{ position = [0.3, 0.0, 0.5] }}
{config}

[component.recorder]
kind = "test.recorder"
trigger = "arm/target"
subscribe = {{ target = "arm/target" }}
"#
    );
    let kinds = [Kind::of::<DmpPolicy>(), Kind::of::<Recorder>()];
    let report = support::run(std::path::Path::new("imitate.toml"), graph, kinds);
    let seen = serde_json::from_value(report.results["recorder"].clone()).unwrap();
    (report, seen)
}

/// A stroke of two seconds that starts and ends at rest.
fn stroke(t: f64) -> [f64; 3] {
    let p = t / 2.0;
    let s = p * p * p * (10.0 - 15.0 * p + 6.0 * p * p);
    [0.4 + 0.2 * s, 0.1 * (std::f64::consts::TAU * s).sin(), 0.5 - 0.2 * s]
}

fn recording(folder: &std::path::Path) -> String {
    let line = |k: u32| {
        let t = f64::from(k) * 0.01;
        let [x, y, z] = stroke(t);
        json!({ "topic": "arm/target", "time_s": 12.0 + t, "value": { "position": [x, y, z], "goal": 1 } })
            .to_string()
            + "\n"
    };
    let path = folder.join("stroke.jsonl");
    std::fs::write(&path, (0..=200).map(line).collect::<String>()).unwrap();
    path.display().to_string()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[test]
fn a_recorded_topic_is_learned_and_reproduced_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let file = recording(folder.path());
    let config = format!(
        "goals = [{{ shape = {{ demonstration = {{ file = \"{file}\", approach = \"1 s\" }} }}, dwell = \"100 ms\" }}]"
    );
    let (report, seen) = run(&config, "");
    assert!(distance(seen[1000], stroke(0.0)) < 1e-9, "the approach ends at the start: {:?}", seen[1000]);
    let worst = (0..=2000).map(|k| distance(seen[1000 + k], stroke(k as f64 * 1e-3))).fold(0.0, f64::max);
    assert!(worst < 2e-3, "off by {worst} m");
    assert!(distance(*seen.last().unwrap(), stroke(2.0)) < 1e-5);
    let result = &report.results["policy"];
    assert_eq!((&result["goals"], &result["finished"]), (&json!(2), &json!(true)));
    let target = &result["imitation"]["target"];
    let number = |name: &str| target[name].as_f64().unwrap();
    assert!(number("path_error_m") < 1e-3 && number("timed_error_m") < 2e-3, "{target}");
    assert!(number("largest_path_error_m") <= worst + 1e-4);
    assert!(result["imitation"]["end_effector"].is_null(), "no robot is measured");
    assert_eq!(support::faults(&report), (Some(0), 0));
}

/// Noise at the ends carries no information about velocity and acceleration there, where only one-sided
/// differences are available.
#[test]
fn noise_at_the_start_of_a_recording_has_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = 12_345_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * 2e-4
    };
    let mut text = String::from("t,x,y,z\n");
    for k in 0..=200 {
        let [x, y, z] = stroke(f64::from(k) * 0.01);
        text += &format!("{},{},{},{}\n", f64::from(k) * 0.01, x + noise(), y + noise(), z + noise());
    }
    let path = folder.path().join("noisy.csv");
    std::fs::write(&path, text).unwrap();
    let config = format!(
        "goals = [{{ shape = {{ demonstration = {{ file = \"{}\", approach = \"1 s\" }} }} }}]",
        path.display()
    );
    let (report, _) = run(&config, "");
    let error = report.results["policy"]["imitation"]["target"]["largest_path_error_m"].as_f64().unwrap();
    assert!(error < 2e-3, "off by {error} m, for noise of 0.1 mm");
}

/// A primitive that deviates by `sway` halfway.
fn swaying(folder: &std::path::Path, name: &str, sway: f64, kernels: usize) -> String {
    let positions = DMatrix::from_fn(201, 3, |k, d| {
        let p = k as f64 / 200.0;
        if d == 1 { sway * 64.0 * (p * (1.0 - p)).powi(3) } else { 0.0 }
    });
    let demonstration = Demonstration::from_positions(1.0, positions).unwrap();
    let settings = Settings { kernels, ..Settings::default() };
    let model = DmpModel::fit(settings, &[demonstration], Regression::default()).unwrap();
    let path = folder.join(name);
    let zeros = vec![0.0; 3];
    let file = PrimitiveFile {
        version: PrimitiveFile::VERSION,
        names: ["x", "y", "z"].map(String::from).to_vec(),
        duration: 1.0,
        start: zeros.clone(),
        start_velocity: zeros.clone(),
        goal: zeros.clone(),
        final_velocity: zeros,
        primitive: Primitive::Discrete(model),
    };
    file.write(&path).unwrap();
    assert!((PrimitiveFile::read(&path).unwrap().duration - 1.0).abs() < 1e-15);
    path.display().to_string()
}

#[test]
fn selected_primitive_shapes_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let (left, right) =
        (swaying(folder.path(), "left.json", 0.1, 30), swaying(folder.path(), "right.json", -0.2, 30));
    let config = format!(
        "primitives = [\"{left}\", \"{right}\"]\nrepeat = \"forever\"\ngoals = [{{ offset = [0.1, 0.0, 0.0], duration = \"1 s\", shape = \"selected\" }}, {{ offset = [-0.1, 0.0, 0.0], duration = \"500 ms\" }}]"
    );
    for (primitive, sway, exchanges) in [(0, 0.1, 0), (1, -0.2, 1)] {
        let (report, seen) = run(&config, &format!("params = {{ primitive = {primitive} }}"));
        assert!((seen[500][1] - sway).abs() < 1e-3, "{:?}", seen[500]);
        assert!(seen[1250][1].abs() < 1e-3, "the return path is straight");
        assert_eq!(report.results["policy"]["exchanges"], exchanges);
        assert_eq!(support::faults(&report), (Some(0), 0));
    }
}

#[test]
fn invalid_demonstrations_are_refused_by_key() {
    let folder = tempfile::tempdir().unwrap();
    let refuse = |config: serde_json::Value| {
        let error = support::refusal::<DmpPolicy>(config, Some("panda"), folder.path());
        (error.key.unwrap(), error.message)
    };
    let shown = |file: &str| json!({ "goals": [{ "shape": { "demonstration": { "file": file } } }] });
    let (key, message) = refuse(shown("none.csv"));
    assert_eq!(key, "goals[0].shape.demonstration.file");
    assert!(message.contains("none.csv"), "{message}");
    std::fs::write(folder.path().join("two.csv"), "t,a,b\n0,1,2\n1,2,3\n2,3,4\n").unwrap();
    let (_, message) = refuse(shown("two.csv"));
    assert_eq!(
        message,
        "2 channels, expected 3 (position of the end effector), 8 (joints of `arm`), or channels named after joints"
    );
    let (key, _) = refuse(json!({ "goals": [{ "offset": [0, 0, 0] }] }));
    assert_eq!(key, "goals[0]");
    let selected = json!({ "goals": [{ "offset": [0, 0, 0], "duration": "1 s", "shape": "selected" }] });
    let (key, message) = refuse(selected);
    assert_eq!(
        (key.as_str(), message.as_str()),
        ("goals[0].shape", "there are no `primitives` to select from")
    );
    let (a, b) = (swaying(folder.path(), "a.json", 0.1, 20), swaying(folder.path(), "b.json", 0.1, 30));
    let (key, _) = refuse(json!({ "goals": [], "primitives": [a, b] }));
    assert_eq!(key, "primitives[1]");
    let torn = std::fs::read_to_string(folder.path().join("a.json")).unwrap();
    std::fs::write(folder.path().join("torn.json"), &torn[..torn.len() / 2]).unwrap();
    let (key, message) = refuse(json!({ "goals": [], "primitives": ["torn.json"] }));
    assert_eq!(key, "primitives[0]");
    assert!(message.contains("torn.json") && message.contains("EOF"), "{message}");
}
