//! Walking robots: whole graphs.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::session::Session;
use motorium::state::{BaseState, TwistTarget};

use crate::support::{MOTORIUM, Run, machine, run, signal, workspace};
use rustix::process::Signal;
use serde_json::json;

#[test]
fn the_quadruped_trots_forward() {
    let graph = workspace().join("graphs/quadruped-trot.toml");
    let ended = run(&graph, &["--clock", "lockstep", "--for", "6 s"]);
    let report = ended.report();
    let physics = &report.results["physics"];
    let numbers = |key: &str| -> Vec<f64> {
        let values = physics[key].as_array().unwrap_or_else(|| panic!("no {key} in {physics}"));
        values.iter().map(|value| value.as_f64().expect("a number")).collect()
    };
    let number = |key: &str| physics[key].as_f64().unwrap_or_else(|| panic!("no {key} in {physics}"));
    let (travel, rpy) = ([number("base_travel_x_m"), number("base_travel_y_m")], numbers("base_rpy"));
    assert!(travel[0] > 0.5, "it went {} m ahead in 6 s", travel[0]);
    assert!(travel[1].abs() < 0.3 * travel[0], "and {} m aside", travel[1]);
    assert!(rpy[0].abs() < 0.2 && rpy[1].abs() < 0.2, "its base leans: {rpy:?}");
    let lowest = number("base_height_lowest_m");
    assert!(lowest > 0.15, "its base came down to {lowest} m");
    assert_eq!(report.components[0].refused, 0);
    for component in &report.components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
        assert_eq!(component.allocations_apart.unwrap_or(0), 0, "{}", component.name);
    }
    let again = run(&graph, &["--clock", "lockstep", "--for", "6 s"]);
    assert_eq!(report.state_hash, again.report().state_hash);
}

#[test]
fn gait_parameters_change_together_or_not_at_all() {
    let _machine = machine();
    let run = Run::start(&workspace().join("graphs/quadruped-trot.toml"), &["--for", "60 s"]);
    let tool = |arguments: &[&str]| {
        let output = Command::new(MOTORIUM)
            .args(["param"])
            .args(arguments)
            .args(["--run", run.folder.id()])
            .output()
            .expect("motorium starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let get = |name: &str| tool(&["get", name]).1.trim().to_string();
    let frequency = get("policy.frequency");
    let (code, _, error) = tool(&["set", "policy.frequency=1.25", "policy.gait=bounds"]);
    assert_eq!(code, Some(1), "{error}");
    assert!(error.contains("did you mean `bound`?") && error.contains("no parameter was changed"), "{error}");
    assert_eq!((get("policy.frequency"), get("policy.gait")), (frequency, "trot".to_string()));

    let all = [
        "set",
        "policy.frequency=1.25",
        "policy.gait=bound",
        "policy.phase_offsets=[0, 0.1, 0, -0.1]",
        "--json",
    ];
    let (code, changes, error) = tool(&all);
    assert_eq!(code, Some(0), "{error}");
    let changes: serde_json::Value = serde_json::from_str(&changes).expect("JSON");
    assert_eq!((&changes[1]["old"], &changes[1]["new"]), (&json!("trot"), &json!("bound")));
    assert_eq!(get("policy.phase_offsets"), "[0, 0.1, 0, -0.1]");
    run.await_steps("policy", 100);
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let policy = &ended.report().results["policy"];
    assert_eq!((&policy["gait"], &policy["gait_changes"]), (&json!("bound"), &json!(1)), "{}", ended.stderr);
}

#[test]
fn the_quadruped_trots_at_the_commanded_velocity() {
    let graph = workspace().join("graphs/quadruped-mpc.toml");
    let trot =
        |arguments: &[&str]| run(&graph, &[&["--clock", "lockstep", "--for", "6 s"][..], arguments].concat());
    let ended = trot(&[]);
    let report = ended.report();
    let planner = &report.results["planner"];
    let number = |key: &str| planner[key].as_f64().unwrap_or_else(|| panic!("no {key} in {planner}"));
    // 0.3 m/s from 1 s on, within 1 m/s2
    let forward = number("forward_m");
    assert!((forward - 1.455).abs() < 0.1, "it went {forward} m ahead in 6 s");
    assert!(number("largest_turn_rad") < 0.2, "{planner}");
    assert_eq!(planner["steps_without_solution"], 0);
    assert_eq!(report.results["controller"]["steps_without_solution"], 0);
    for component in &report.components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
        assert_eq!(component.allocations_apart.unwrap_or(0), 0, "{}", component.name);
    }
    assert_eq!(report.state_hash, trot(&[]).report().state_hash);
    let aside = ["planner.config.velocity=[0.0, 0.15, 0.0]", "physics.config={ pushes = [] }"];
    let aside = trot(&["--set", aside[0], "--set", aside[1]]);
    let moved = aside.report().results["physics"]["base_travel_y_m"].as_f64().expect("a number");
    assert!((moved - 0.74).abs() < 0.1, "it went {moved} m aside");
}

#[test]
fn the_quadruped_trots_up_a_slope_by_sensing_with_its_feet() {
    let graph = workspace().join("graphs/quadruped-slope.toml");
    let ended = run(&graph, &["--clock", "lockstep"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let planner = &ended.report().results["planner"];
    // the slope of the terrain, as far as it is visible between the stones
    let slope = planner["ground_slope"][0].as_f64().expect("a number");
    assert!((slope - 0.12_f64.tan()).abs() < 0.06, "{planner}");
    let count = |key: &str| planner[key].as_u64().expect("a number");
    assert!(count("early_landings") > 0 && count("late_landings") > 0, "{planner}");
    let moved = ended.report().results["physics"]["base_travel_x_m"].as_f64().expect("a number");
    assert!(moved > 2.0, "it went {moved} m ahead");
    for component in &ended.report().components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
}

#[test]
fn the_quadruped_trots_on_its_policy() {
    let graph = workspace().join("graphs/quadruped-policy.toml");
    let ended = run(&graph, &["--clock", "lockstep"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let report = ended.report();
    assert_eq!(report.expectations.len(), 3);
    // through five pushes
    let moved = report.results["physics"]["base_travel_x_m"].as_f64().expect("a number");
    assert!(moved > 5.0, "it went {moved} m ahead");
    for component in &report.components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
        assert_eq!(component.allocations_apart.unwrap_or(0), 0, "{}", component.name);
    }
    assert_eq!(report.state_hash, run(&graph, &["--clock", "lockstep"]).report().state_hash);
}

/// Distance that the quadruped walked by its trained policy, forwards and to the left, m, and its heading,
/// rad.
fn walked(arguments: &[&str]) -> [f64; 3] {
    let graph = workspace().join("graphs/quadruped-ppo.toml");
    let ended = run(&graph, &[&["--clock", "lockstep"][..], arguments].concat());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let report = ended.report();
    for component in report.components.iter().filter(|component| component.name != "physics") {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
    let physics = &report.results["physics"];
    let numbers = [&physics["base_travel_x_m"], &physics["base_travel_y_m"], &physics["base_rpy"][2]];
    numbers.map(|number| number.as_f64().unwrap_or_else(|| panic!("no number in {physics}")))
}

#[test]
fn the_quadruped_walks_on_its_trained_policy() {
    let [forward, left, _] = walked(&[]);
    assert!(forward > 5.0 && left.abs() < 1.0, "{forward} m forward, {left} m to the left");
    let turning = ["--set", "component.policy.config.command=[0.0, 0.0, 0.5]", "--for", "5s"];
    let [forward, left, heading] = walked(&turning);
    assert!((1.5..3.0).contains(&heading), "{heading} rad");
    assert!(forward.hypot(left) < 0.5, "{forward} m forward, {left} m to the left");
    // 1.6 m are commanded
    for (velocity, side) in [("0.2", 1.0), ("-0.2", -1.0)] {
        let command = format!("component.policy.config.command=[0.0, {velocity}, 0.0]");
        let [forward, left, _] = walked(&["--set", &command, "--for", "8s"]);
        assert!(side * left > 1.0 && forward.abs() < 0.5, "{forward} m forward, {left} m to the left");
    }
}

#[test]
fn the_trained_policy_walks_on_simulated_drives() {
    let overlay = workspace().join("graphs/overlays/quadruped-can.toml");
    let [forward, left, _] = walked(&["--with", overlay.to_str().expect("a path")]);
    assert!(forward > 5.0 && left.abs() < 1.5, "{forward} m forward, {left} m to the left");
}

#[test]
fn the_quadruped_stands_on_simulated_drives() {
    let overlay = workspace().join("graphs/overlays/quadruped-can.toml");
    let graph = workspace().join("graphs/quadruped-stand.toml");
    let ended = run(&graph, &["--with", overlay.to_str().expect("a path"), "--for", "2s"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(!ended.report().expectations.is_empty());
}

/// A course: commands, forward and left, m/s, and turn, rad/s, each with its duration, s.
const COURSE: [(f64, [f64; 3]); 3] =
    [(14.0, [0.4, 0.0, 0.0]), (11.5, [0.0, 0.2, 0.0]), (7.0, [0.0, 0.0, 0.5])];

/// Pushes of 1.5 N s along the course, in the heading at its start.
const PUSHES: &str = r#"
pushes = [
    { at = "4 s", duration = "100 ms", force = [0.0, 15.0, 0.0] },
    { at = "8 s", duration = "100 ms", force = [-15.0, 0.0, 0.0] },
    { at = "12 s", duration = "100 ms", force = [0.0, -15.0, 0.0] },
    { at = "20 s", duration = "100 ms", force = [0.0, -15.0, 0.0] },
    { at = "29 s", duration = "100 ms", force = [15.0, 0.0, 0.0] },
]
"#;

/// Motion of a quadruped on the course.
#[derive(Debug, Default)]
struct Course {
    /// Distance of each part along its command, from the pose at its start, m, and the last angle, rad.
    travel: [f64; 3],
    /// Root of the mean square of the velocity error, averaged over strides: in the plane, m/s, and about the
    /// vertical, rad/s.
    errors: [f64; 2],
    lowest: f64,
    largest_tilt: f64,
}

/// Sends a quadruped along the course; `component` of the graph follows the topic at its port.
fn course(folder: &Path, graph: &str, (component, port): (&str, &str)) -> Course {
    let below = workspace().join("graphs").join(graph);
    let path = folder.join(format!("course-{graph}"));
    let text = format!(
        r#"
extends = "{}"
clock   = "lockstep"

[component.physics.config]
{PUSHES}
[component.commands]
kind    = "sensor.udp"
rate    = "100 Hz"
publish = {{ value = "quadruped/command" }}
config  = {{ type = "motorium.TwistTarget", port = 7400 }}

[component.{component}.subscribe]
{port} = "quadruped/command"
"#,
        below.display()
    );
    let registry = motorium_tools::registry();
    let checked = graph::check(&path, text, &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let options = Options::inline().standing_in_for("commands");
    let mut session = Session::launch(plan, &registry, &options).expect("it starts");
    let mut found = Course { lowest: f64::INFINITY, ..Course::default() };
    let (mut reference, mut differences) = ([0.0; 3], Vec::new());
    let period = Duration::from_millis(10);
    // both stand, or trot on the spot, for 1.5 s
    let mut time = Duration::ZERO;
    for (part, (seconds, command)) in [(1.5, [0.0; 3])].into_iter().chain(COURSE).enumerate() {
        let [forward, left, turn] = command;
        let end = time + Duration::from_secs_f64(seconds);
        let (mut start, mut angle) = (None, 0.0);
        while time < end {
            let target = TwistTarget { linear: [forward, left, 0.0], angular: [0.0, 0.0, turn] };
            session.publish("quadruped/command", &target).expect("it is published");
            time += period;
            session.step_until(time).expect("it steps");
            let base = session.read::<BaseState>("quadruped/true_base_state").expect("a topic");
            let base = base.expect("a state").value;
            let [x, y, z, w] = base.orientation;
            let heading = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
            let tilt = (1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0).acos();
            found.lowest = found.lowest.min(base.position[2]);
            found.largest_tilt = found.largest_tilt.max(tilt);
            if part == 0 {
                continue;
            }
            let (from, ahead) = *start.get_or_insert((base.position, heading));
            let moved = [base.position[0] - from[0], base.position[1] - from[1]];
            let along = [
                ahead.cos() * moved[0] + ahead.sin() * moved[1],
                ahead.cos() * moved[1] - ahead.sin() * moved[0],
            ];
            angle += 0.01 * base.angular_velocity[2];
            found.travel[part - 1] = [along[0], along[1], angle][part - 1];
            // the reference of `control.mpc` accelerates by 1 m/s2 and 1 rad/s2
            let measured = [base.linear_velocity[0], base.linear_velocity[1], base.angular_velocity[2]];
            for (reference, command) in reference.iter_mut().zip(command) {
                *reference += (command - *reference).clamp(-0.01, 0.01);
            }
            differences.push([0, 1, 2].map(|k| measured[k] - reference[k]));
        }
    }
    // a stride has 36 periods
    let strides = differences.windows(36).map(|stride| {
        [0, 1, 2].map(|k| stride.iter().map(|difference| difference[k]).sum::<f64>() / stride.len() as f64)
    });
    let squares = strides.map(|[x, y, turn]| [x * x + y * y, turn * turn]);
    let sum = squares.fold([0.0; 2], |sum, square| [sum[0] + square[0], sum[1] + square[1]]);
    found.errors = sum.map(|sum| (sum / (differences.len() - 35) as f64).sqrt());
    found
}

#[test]
fn policy_tracks_its_command_through_pushes() {
    let folder = tempfile::tempdir().expect("a folder");
    let teacher = course(folder.path(), "quadruped-mpc.toml", ("planner", "target"));
    let policy = course(folder.path(), "quadruped-policy.toml", ("policy", "command"));
    for found in [&teacher, &policy] {
        assert!(found.lowest > 0.18 && found.largest_tilt < 0.8, "{found:?}");
        assert!(found.travel[0] > 5.0 && found.travel[1] > 2.0 && found.travel[2] > 3.0, "{found:?}");
    }
    for (found, known) in policy.errors.iter().zip(teacher.errors) {
        assert!(*found <= 1.5 * known, "policy {policy:?}, teacher {teacher:?}");
    }
}
