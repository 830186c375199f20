//! An arm on one classic bus behind a simulated adapter on a pseudo-terminal, used by the kernel driver. The
//! desk simulates arm, drives and bus; the graph of the arm is the same as for real hardware.

use std::path::Path;

use super::{drives, number, row};
use serde_json::Value;

/// Writes the graphs of desk and arm, and their drive tables.
pub(crate) fn write(folder: &Path) {
    let put = |name: &str, text: String| std::fs::write(folder.join(name), text).expect("a file");
    let panda = std::fs::read_to_string(folder.join("drives/panda-vcan.toml")).expect("the drive table");
    // the kernel driver supports classic frames only
    let classic: Vec<&str> = panda.lines().filter(|line| !line.starts_with("data_bitrate")).collect();
    let classic = classic.join("\n");
    put("drives/desk.toml", classic.replace("\"vcan0\"", "\"pty:/tmp/can0\""));
    put("drives/slcan.toml", classic.replace("\"vcan0\"", "\"can0\""));
    put("desk.toml", DESK.to_string());
    put("slcan.toml", ARM.to_string());
}

const DESK: &str = r#"
extends = "arm-can.toml"
remove  = ["component.adapter", "component.policy", "component.controller", "expect", "latency"]
name    = "desk"

[component.physics]
rate = "1 kHz"

[component.drives]
rate   = "2 kHz"
config = { drives = "drives/desk.toml" }
"#;

const ARM: &str = r#"
extends = "arm-can.toml"
remove  = ["component.physics", "component.drives", "latency"]
name    = "slcan"
latency = [{ from = "panda/joint_state", to = "panda/joint_command", max = "7 ms" }]
safety.stale_after = "12 ms"

[component.adapter]
rate   = "200 Hz"
config = { drives = "drives/slcan.toml" }
"#;

/// The results of the arm and of the desk in a row; `None` if the row was not run.
fn both(name: &str) -> Option<(Value, Value)> {
    let (arm, desk) = (row(name)?, row(&format!("{name}_desk"))?);
    Some((arm.results(), desk.results()))
}

fn let_go(desk: &Value) -> usize {
    drives(desk, |drive| number(&drive["watchdog_trips"]) >= 1 && drive["enabled"] == false)
}

#[test]
fn the_arm_moves_through_the_kernel_driver() {
    let Some((arm, desk)) = both("slcan") else { return };
    let adapter = &arm["adapter"];
    row("slcan").expect("it was run").assert_steady(adapter);
    assert!(adapter["enabled_in_cycle"].is_u64(), "{adapter}");
    // eight drives of two frames of 111 to 135 bits in 5 ms
    let load = adapter["buses"]["can0"]["load"].as_f64().expect("a number");
    assert!((0.2..0.45).contains(&load), "{load}");
    let disabled = drives(&desk, |drive| drive["enabled"] == false);
    assert_eq!(disabled, 8, "an orderly end disables the drives: {desk}");
}

#[test]
fn a_full_kernel_queue_refuses_frames() {
    let Some((arm, desk)) = both("slcan_alone") else { return };
    let (adapter, bus) = (&arm["adapter"], &arm["adapter"]["buses"]["can0"]);
    assert!(number(&bus["queue_full"]) >= 1 && number(&bus["unsent"]) >= 8, "{bus}");
    assert_eq!(bus["diagnosis"], "nobody acknowledges on `can0`: power, bitrate, termination?");
    assert_eq!(adapter["tripped"], true, "{adapter}");
    assert_eq!(let_go(&desk), 8, "{desk}");
}

#[test]
fn an_error_passive_controller_is_reported() {
    let Some((arm, _)) = both("slcan_passive") else { return };
    let bus = &arm["adapter"]["buses"]["can0"];
    assert_eq!(
        (&bus["worst_condition"], &bus["condition"], &bus["bus_off"]),
        (&Value::from("passive"), &Value::from("active"), &Value::from(0)),
        "{bus}"
    );
    assert_eq!(arm["adapter"]["tripped"], false, "{arm}");
}

#[test]
fn a_kernel_controller_leaves_and_rejoins_the_bus() {
    let Some((arm, desk)) = both("slcan_bus_off") else { return };
    let bus = &arm["adapter"]["buses"]["can0"];
    assert!(number(&bus["bus_off"]) >= 1, "{bus}");
    assert_eq!(
        (&bus["condition"], &arm["adapter"]["tripped"]),
        (&Value::from("active"), &Value::from(true)),
        "{bus}"
    );
    assert_eq!(let_go(&desk), 8, "{desk}");
}

#[test]
fn unplugged_adapter_is_found_again_under_its_name() {
    let Some((arm, desk)) = both("slcan_unplugged") else { return };
    let bus = &arm["adapter"]["buses"]["can0"];
    assert!(number(&bus["down"]) >= 1, "{bus}");
    assert_eq!(
        (&bus["worst_condition"], &bus["condition"], &arm["adapter"]["tripped"]),
        (&Value::from("gone"), &Value::from("active"), &Value::from(true)),
        "{bus}"
    );
    assert_eq!(let_go(&desk), 8, "{desk}");
}
