//! `graphs/panda-can-sim.toml`, `graphs/panda-twin.toml` and `graphs/so101-sim.toml` as a user runs them:
//! arms behind simulated buses and drives, in lockstep.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The report of a run of ten simulated seconds.
fn run(graph: &str, arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_motorium"))
        .args(["run", graph, "--clock", "lockstep", "--for", "10s", "--json", "--hosting", "threads"])
        .args(arguments)
        .current_dir(workspace())
        .output()
        .expect("the command starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{graph}: {errors}");
    serde_json::from_slice(&output.stdout).expect("a report")
}

#[test]
fn arm_reaches_its_goals_over_can_buses() {
    let with = run("graphs/panda-can-sim.toml", &[]);
    let without = run("graphs/panda-reach.toml", &[]);
    for error in ["position_error_m", "orientation_error_rad"] {
        let of = |report: &Value| report["results"]["controller"][error].as_f64().expect("a number");
        assert!(of(&with) <= 1.2 * of(&without), "{error}: {} and {}", of(&with), of(&without));
    }
    assert_eq!(with["results"]["controller"]["goals_missed"], 0);
    let adapter = &with["results"]["adapter"];
    assert_eq!(adapter["cycles"], 10_000);
    assert_eq!((&adapter["missing_replies"], &adapter["late_replies"]), (&Value::from(0), &Value::from(0)));
    let load = adapter["bus_load"].as_f64().expect("a number");
    // two drives of at most 270 bits and at least 222 in a cycle of 1000
    assert!((0.44..0.54).contains(&load), "{load}");
    assert_eq!(adapter["joints"].as_object().map(serde_json::Map::len), Some(8));
    for component in with["components"].as_array().expect("a list") {
        assert_eq!(component["allocations"], 0, "{component}");
    }
}

#[test]
fn two_runs_with_faults_are_identical_bit_for_bit() {
    let faults = r#"component.drives.config.faults=[{ at = "2 s", lasts = "2 ms", kind = "silent", joint = "panda_joint4" }]"#;
    let arguments = ["--set", faults, "--set", "component.drives.config.jitter=\"30 us\""];
    let (one, two) =
        (run("graphs/panda-can-sim.toml", &arguments), run("graphs/panda-can-sim.toml", &arguments));
    assert!(one["state_hash"].is_string());
    assert_eq!(one["state_hash"], two["state_hash"]);
    assert_eq!(one["results"]["adapter"]["joints"]["panda_joint4"]["missing_replies"], 2);
    assert_eq!(one["results"]["adapter"]["tripped"], false);
}

#[test]
fn twin_follows_the_measured_arm_and_pushes_its_box() {
    let report = run("graphs/panda-twin.toml", &[]);
    let twin = &report["results"]["twin"];
    // until the adapter has measured the arm
    assert!(twin["steps_held"].as_u64().is_some_and(|steps| steps < 100), "{twin}");
    assert_eq!((&twin["states_refused"], &twin["steps"]), (&Value::from(0), &Value::from(10_000)));
    let pushed = twin["objects"]["box"]["position"][1].as_f64().expect("a number");
    assert!((1.475..1.6).contains(&pushed), "the hand pushes the box from 1.465 m to {pushed} m");
    let component = report["components"].as_array().expect("a list").iter();
    let mut twins = component.filter(|component| component["name"] == "twin");
    let twin = twins.next().expect("the twin");
    assert_eq!((&twin["allocations"], &twin["gate"]), (&Value::from(0), &Value::Null));
}

#[test]
fn check_prints_that_a_twin_is_no_actuator() {
    let output = Command::new(env!("CARGO_BIN_EXE_motorium"))
        .args(["check", "graphs/panda-twin.toml"])
        .current_dir(workspace())
        .output()
        .expect("the command starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("`twin` moves its robot along followed states, without actuator"), "{text}");
}

#[test]
fn printed_arm_repeats_its_poses_exactly() {
    let (one, two) = (run("graphs/so101-sim.toml", &[]), run("graphs/so101-sim.toml", &[]));
    assert!(one["state_hash"].is_string());
    assert_eq!(one["state_hash"], two["state_hash"]);
    let (adapter, policy) = (&one["results"]["adapter"], &one["results"]["policy"]);
    assert_eq!((&adapter["cycles"], &adapter["missing_replies"]), (&Value::from(2000), &Value::from(0)));
    assert_eq!((&adapter["tripped"], &adapter["refused_frames"]), (&Value::from(false), &Value::from(0)));
    let joints = adapter["joints"].as_object().expect("a table");
    assert!(joints.len() == 6 && joints.values().all(|joint| joint["phase"] == "enabled"), "{adapter}");
    assert_eq!(policy["goals_missed"], 0);
    assert!(policy["goals_reached"].as_u64().is_some_and(|count| count >= 4), "{policy}");
}

#[test]
fn log_is_decoded_by_a_database() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("ride.log");
    let heartbeat = "(1735270496.916858) can0 061#4000000008000000";
    let estimates = "(1735270496.926858) can0 069#0000803F000000BF";
    std::fs::write(&log, format!("{heartbeat}\n{estimates}\n(1735270496.930000) can0 7FF#00\n"))
        .expect("a file");
    let read = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_motorium"))
            .args(["can", "log", "--read", log.to_str().expect("text"), "--dbc"])
            .arg("components/can/tests/can/databases/odrive.dbc")
            .args(arguments)
            .current_dir(workspace())
            .output()
            .expect("the command starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, text, errors) = read(&["--dbc-mask", "0x1f"]);
    assert_eq!(code, Some(0), "{errors}");
    let expected = [
        format!("{heartbeat} :: Heartbeat(Axis_Error: 64, Axis_State: CLOSED_LOOP_CONTROL)"),
        format!("{estimates} :: Get_Encoder_Estimates(Pos_Estimate: 1 rev, Vel_Estimate: -0.5 rev/s)"),
        "(1735270496.930000) can0 7FF#00".to_string(),
    ];
    assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    // a database of node 0 alone decodes none of them
    assert!(!read(&[]).1.contains("::"));
    assert_eq!(read(&["--dbc-mask", "0x3f"]).0, Some(0));
    let (code, _, errors) = read(&["--dbc-mask", "0x1"]);
    assert!(code == Some(3) && errors.contains("have the same identifier under the mask 0x1"), "{errors}");
    std::fs::write(&log, "(1735270496.916858) can0 061#4\n").expect("a file");
    let (code, _, errors) = read(&[]);
    assert!(code == Some(3) && errors.contains("ride.log, line 1, column 26: "), "{errors}");
}

#[test]
fn mistakes_in_a_log_are_named_with_place_and_help() {
    let folder = tempfile::tempdir().expect("a folder");
    let read = |content: &str, arguments: &[&str]| {
        let log = folder.path().join("ride.log");
        std::fs::write(&log, content).expect("a file");
        let output = Command::new(env!("CARGO_BIN_EXE_motorium"))
            .args(["can", "log", "--read", log.to_str().expect("text")])
            .args(arguments)
            .output()
            .expect("the command starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let good = "(1735270496.916858) can0 061#4000000008000000\n";
    assert_eq!(read(good, &["--count", "1"]), (Some(0), String::new()));
    let (code, errors) = read(&format!("{good}\n(1735270496.926858) can0\n"), &[]);
    assert_eq!(code, Some(3), "{errors}");
    assert!(
        errors.contains("ride.log, line 3, column 25: ") && !errors.contains("Invalid timestamp"),
        "{errors}"
    );
    assert!(
        errors.contains("expected a frame, such as `123#0102`; a log has lines of `candump -L`"),
        "{errors}"
    );
    for empty in ["", "\n\n", "base hex  timestamps absolute\n"] {
        let (code, errors) = read(empty, &[]);
        assert!(
            code == Some(1) && errors.contains("ride.log: found no frames, expected at least one"),
            "{errors}"
        );
    }
    let (code, errors) = read(good, &["--count", "0"]);
    assert!(code == Some(2) && errors.contains("0 is not in 1.."), "{errors}");
}
