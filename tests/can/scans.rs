//! Searches for drives on interfaces of the kernel: two moteus on one of CAN FD, and a drive that sends classic frames on another.

use std::path::Path;

use super::row;

/// Writes the graph of the drives, and their drive table.
pub(crate) fn write(folder: &Path) {
    let put = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("a file");
    put("drives/alone.toml", TABLE);
    put("drives-alone.toml", GRAPH);
}

const TABLE: &str = r#"
[[bus]]
name      = "classic"
interface = "vcan0"
bitrate   = 1_000_000

[[bus]]
name         = "fast"
interface    = "vcan1"
bitrate      = 1_000_000
data_bitrate = 5_000_000

[[drive]]
joint    = "joint1"
bus      = "classic"
protocol = "damiao"
node     = 4
master   = 0x14
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 10.0 }

[[drive]]
joint    = "joint2"
bus      = "fast"
protocol = "moteus"
node     = 9
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 10.0 }

[[drive]]
joint    = "joint3"
bus      = "fast"
protocol = "moteus"
node     = 126
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 10.0 }
"#;

const GRAPH: &str = r#"
name  = "drives-alone"
clock = "realtime"

[robot.arm]
urdf = "planar-3r"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "1 kHz"
budget    = "150 us"
config    = { plant = true }
subscribe = { joint_command = "drive_efforts" }
publish   = { joint_state = "true_joint_state" }

[component.drives]
kind      = "can.drive_sim"
robot     = "arm"
rate      = "2 kHz"
budget    = "60 us"
subscribe = { joint_state = "true_joint_state" }
publish   = { joint_command = "drive_efforts" }
config    = { drives = "drives/alone.toml" }
"#;

#[test]
fn drives_of_can_fd_are_found_on_an_interface_of_the_kernel_and_none_is_enabled() {
    let (Some(found), Some(desk)) = (row("scan_fd"), row("scanned_desk")) else { return };
    let report = found.report();
    let devices: Vec<_> = report["devices"].as_array().expect("devices").iter().collect();
    let nodes: Vec<_> = devices.iter().map(|device| (&device["node"], &device["protocol"])).collect();
    let expected = [9, 126].map(|node| (serde_json::Value::from(node), serde_json::Value::from("moteus")));
    assert_eq!(nodes, expected.each_ref().map(|(node, kind)| (node, kind)), "{report}");
    assert_eq!((found.code, &report["fd_search"]["outcome"]), (0, &"complete".into()), "{report}");
    assert_eq!(super::drives(&desk.results(), |drive| drive["enabled"] == true), 0, "{desk:?}");
}

#[test]
fn no_frame_of_can_fd_is_sent_on_an_interface_with_a_drive_that_sends_classic_frames() {
    let Some(found) = row("scan_classic") else { return };
    let report = found.report();
    assert_eq!(report["fd_search"]["outcome"], "classic", "{report}");
    assert_eq!((&report["devices"][0]["node"], &report["devices"][1]), (&4.into(), &serde_json::Value::Null));
}

#[test]
fn an_interface_of_the_kernel_that_carries_no_can_fd_is_refused_with_the_next_step() {
    let Some(refused) = row("scan_no_fd") else { return };
    assert_eq!(refused.code, 1, "{refused:?}");
    let said = format!("{} {}", refused.text, refused.errors);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("`vcan1` does not carry CAN FD"), "{refused:?}");
}
