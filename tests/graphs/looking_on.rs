//! A crate made by `motorium new`, whose graph is checked, run, and observed while it runs.

use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use crate::program::{complaint, json, machine, motorium, printed};
use crate::support::{ANY_LOSS, Run};
use serde_json::Value;

/// The component that `motorium new` writes.
const NEW_COMPONENT: &str = env!("CARGO_BIN_EXE_new-component");

/// A crate as created by `motorium new`, except for its program: the same component, built with these tests.
fn made(parent: &Path, name: &str) -> PathBuf {
    let parent = parent.to_str().expect("a path of text");
    let made = json(&["new", name, "--path", parent, "--json"]);
    let folder = PathBuf::from(made["folder"].as_str().expect("a folder"));
    let graph = folder.join("graph.toml");
    let text = std::fs::read_to_string(&graph).expect("a graph");
    let exec = format!("\"target/release/{name}\"");
    assert!(text.contains(&exec), "{text}");
    std::fs::write(&graph, text.replace(&exec, &format!("{NEW_COMPONENT:?}"))).expect("written");
    graph
}

/// A running graph, which is ended on drop.
struct Running(Child);

impl Running {
    fn start(graph: &Path, name: &str) -> Self {
        let graph = graph.to_str().expect("a path of text");
        let child = motorium(&["run", graph, "--for", "120s", "--json"])
            .args(ANY_LOSS)
            .spawn()
            .expect("the program starts");
        let running = Self(child);
        let deadline = Instant::now() + Duration::from_secs(60);
        loop {
            let output = crate::program::run(&["topic", "list", "--run", name, "--for", "50ms", "--json"]);
            let rows: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
            if rows.as_array().is_some_and(|rows| rows.iter().all(|row| row["published"].as_u64() > Some(1)))
            {
                return running;
            }
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(Instant::now() < deadline, "the graph does not start: {rows} {errors}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn interrupt(mut self) -> bool {
        let pid = rustix::process::Pid::from_child(&self.0);
        rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it is there");
        self.0.wait().expect("it ends").success()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let pid = rustix::process::Pid::from_child(&self.0);
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        let _ = self.0.wait();
    }
}

#[test]
fn running_graph_shows_topics_and_accepts_parameters() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let name = format!("looked-at-{}", std::process::id());
    let run = name.as_str();
    let graph = made(folder.path(), run);
    let running = Running::start(&graph, run);

    lists_topics(run);
    echoes_samples(run);
    measures_rates(run);
    shows_layouts(run);
    sets_parameters(run);
    is_drawn_as_it_runs(run);

    assert!(running.interrupt(), "an interrupted run ends in good order");
    let text = complaint(&["topic", "list", "--run", run]);
    assert!(text.contains(&format!("no run is called `{run}`")), "{text}");
}

fn lists_topics(run: &str) {
    let rows = json(&["topic", "list", "--run", run, "--json"]);
    let rows = rows.as_array().expect("rows");
    // The topics of the graph, and the log of events.
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[2]["name"], "motorium/events");
    let state = rows.iter().find(|row| row["name"] == "panda/joint_state").expect("the state");
    assert_eq!(state["type"], "motorium.JointState");
    assert_eq!(state["pattern"], "state");
    assert_eq!(state["writer"], "physics");
    assert_eq!(state["readers"], serde_json::json!(["controller"]));
    // The rate never exceeds the 1 kHz grid; how much of the grid a busy machine reaches does not matter
    // here.
    let rate = state["rate_hz"].as_f64().expect("a rate");
    assert!(rate > 0.0 && rate < 1500.0, "{rate}");
    assert!(state["age_ns"].is_u64());
    let table = printed(&["topic", "list", "--run", run]);
    assert!(table.contains("panda/joint_command") && !table.contains('\x1b'), "{table}");
}

fn echoes_samples(run: &str) {
    let text = printed(&[
        "topic",
        "echo",
        "panda/joint_state",
        "--run",
        run,
        "--count",
        "3",
        "--rate",
        "50",
        "--json",
    ]);
    let samples: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(samples.len(), 3);
    for pair in samples.windows(2) {
        assert!(pair[0]["sequence"].as_u64() < pair[1]["sequence"].as_u64());
        assert!(pair[0]["publish_time_ns"].as_u64() < pair[1]["publish_time_ns"].as_u64());
    }
    let value = &samples[0]["value"];
    assert_eq!(samples[0]["publisher"], "physics");
    assert_eq!(value["count"], 8);
    for field in ["position", "velocity", "effort"] {
        let numbers = value[field].as_array().expect(field);
        assert!(numbers.len() == 8 && numbers.iter().all(Value::is_f64), "{field}: {numbers:?}");
    }
    // The arm rests in its ready pose except for the base.
    let elbow = value["position"][3].as_f64().expect("a number");
    assert!((elbow + 2.356).abs() < 0.05, "{elbow}");
    assert!(value.get("reserved").is_none());

    let every = printed(&["topic", "echo", "panda/joint_command", "--run", run, "--every", "--count", "5"]);
    let of = |joint: &str| every.lines().filter(|line| line.trim_start().starts_with(joint)).count();
    assert_eq!((of("panda_joint4 "), of("panda_finger_joint1 ")), (5, 5), "a line for each joint: {every}");
    assert!(every.contains("kp") && every.lines().all(|line| line.chars().count() <= 80), "{every}");

    let wrong = complaint(&["topic", "echo", "panda/joint_sate", "--run", run]);
    assert!(wrong.contains("did you mean `panda/joint_state`?"), "{wrong}");
}

#[test]
fn slices_of_any_size_are_echoed_in_place() {
    let _machine = machine();
    let run = Run::start(Path::new("graphs/lidar-drive.toml"), &["--for", "60 s"]);
    let id = run.folder.id();
    let sample = |topic: &str| json(&["topic", "echo", topic, "--run", id, "--count", "1", "--json"]);
    let cloud = sample("rover/points");
    let points = cloud["value"].as_array().expect("an array of points");
    assert!(!points.is_empty() && points.len() <= 360, "{}", points.len());
    assert!(points.iter().all(|point| point["x"].is_f64() && point["intensity"].is_f64()), "{cloud}");
    assert_eq!(cloud["publisher"], "lidar");
    let depth = sample("rover/depth");
    let bytes = depth["value"].as_array().expect("an array of bytes");
    assert!(bytes.len() == 160 * 120 * 4 && bytes.iter().all(Value::is_u64), "{}", bytes.len());
    let text = printed(&["topic", "echo", "rover/points", "--run", id, "--every", "--count", "2"]);
    assert_eq!(text.matches("elements of motorium.CloudPoint").count(), 2, "{text}");
    assert!(text.contains("  [0] x ") && text.contains("more; --json prints all"), "{text}");
    let measured = json(&["topic", "hz", "rover/points", "--run", id, "--for", "1s", "--json"]);
    assert!(measured["received"].as_u64() > Some(1), "{measured}");
}

fn measures_rates(run: &str) {
    let measured = json(&["topic", "hz", "panda/joint_command", "--run", run, "--for", "300ms", "--json"]);
    assert!(measured["received"].as_u64() > Some(1), "{measured}");
    let rate = measured["rate_hz"].as_f64().expect("a rate");
    assert!(rate > 0.0 && rate < 1500.0, "{measured}");
    let interval = &measured["interval_ns"];
    assert!(interval["p50"].as_u64() <= interval["max"].as_u64(), "{measured}");
}

fn shows_layouts(run: &str) {
    let detail = json(&["topic", "info", "panda/joint_command", "--run", run, "--json"]);
    assert_eq!(detail["layout"]["type_name"], "motorium.JointCommand");
    let names: Vec<_> =
        detail["layout"]["fields"].as_array().expect("fields").iter().map(|field| &field["name"]).collect();
    assert_eq!(names, ["count", "reserved", "position", "velocity", "effort", "kp", "kd"]);
    assert_eq!(detail["triggers"], serde_json::json!([]), "physics reads it at its own times");
    assert_eq!(detail["readers"], serde_json::json!(["physics"]));
}

fn is_drawn_as_it_runs(run: &str) {
    let picture = printed(&["graph", "--measured", run]);
    let physics = picture.lines().find(|line| line.contains("<b>physics</b>")).expect("a component");
    assert!(physics.ends_with(" Hz\"]"), "its rate comes last: {physics}");
    assert!(picture.contains("panda/joint_state<br/>JointState<br/>read after p50 "), "{picture}");
    let unknown = complaint(&["graph", "--measured", "nobody"]);
    assert!(unknown.contains("no run is called `nobody`"), "{unknown}");
}

fn sets_parameters(run: &str) {
    let rows = json(&["param", "list", "--run", run, "--json"]);
    assert_eq!(rows[0]["name"], "controller.frequency");
    assert_eq!(rows[0]["unit"], "Hz");
    assert_eq!(printed(&["param", "get", "controller.frequency", "--run", run]), "0.5\n");
    let change = json(&["param", "set", "controller.frequency", "1", "--run", run, "--json"]);
    assert_eq!((&change["old"], &change["new"]), (&Value::from(0.5), &Value::from(1.0)));
    assert_eq!(printed(&["param", "get", "controller.frequency", "--run", run]), "1\n");
    let refused = complaint(&["param", "set", "controller.frequency", "99", "--run", run]);
    assert!(
        refused.contains("expected from 0.05 to 2") && refused.contains("the value remains 1 Hz"),
        "{refused}"
    );
    let unknown = complaint(&["param", "get", "controller.frequencey", "--run", run]);
    assert!(unknown.contains("did you mean `controller.frequency`?"), "{unknown}");
}

#[test]
fn a_new_crate_has_a_valid_graph_once_it_is_built() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = made(folder.path(), "my-controller");
    let graph = graph.to_str().expect("a path of text");
    let checked = json(&["check", graph, "--json"]);
    assert_eq!(checked["valid"], true, "{checked}");
    assert_eq!(checked["diagnostics"], serde_json::json!([]), "and nothing to warn of");

    let report = json(&["run", graph, "--clock", "lockstep", "--for", "2s", "--json"]);
    let error = report["results"]["controller"]["largest_error_rad"].as_f64().expect("a result");
    assert!(error > 1e-6 && error < 0.02, "the arm moves and follows: {error}");

    let kept = folder.path().join("report.json");
    let kept = kept.to_str().expect("a path of text");
    std::fs::write(kept, report.to_string()).expect("written");
    let picture = printed(&["graph", graph, "--measured", kept, "--format", "svg"]);
    assert!(picture.contains(">read after p50 ") && picture.contains(" Hz<"), "{picture}");
    let other = complaint(&["graph", "--measured", graph]);
    assert!(other.contains("is not a report of a run"), "{other}");
}

#[test]
fn existing_crate_is_never_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let parent = folder.path().to_str().expect("a path of text");
    printed(&["new", "mine", "--path", parent]);
    let graph = folder.path().join("mine/graph.toml");
    std::fs::write(&graph, "precious").expect("written");
    let text = complaint(&["new", "mine", "--path", parent]);
    assert!(text.contains("already exists"), "{text}");
    assert_eq!(std::fs::read_to_string(graph).expect("still there"), "precious");
    assert!(complaint(&["new", "My Arm", "--path", parent]).contains("try `my-arm`"));
}
