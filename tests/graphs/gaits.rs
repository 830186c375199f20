//! Walking robots: whole graphs.

use std::process::Command;
use std::time::Duration;

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
    assert!(error.contains("did you mean `bound`?") && error.contains("nothing was set"), "{error}");
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
    std::thread::sleep(Duration::from_millis(200));
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
