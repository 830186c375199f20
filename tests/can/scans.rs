//! Searches for drives on kernel interfaces: two moteus drives on a CAN FD interface, and a drive with
//! classic frames on another.

use std::path::Path;

use super::{arms, row};

/// Writes the graph of the drives, and their drive table.
pub(crate) fn write(folder: &Path) {
    let put = |name: &str, text: String| std::fs::write(folder.join(name), text).expect("a file");
    put("drives/alone.toml", table());
    put("drives-alone.toml", arms::graph("drives-alone", "planar-3r", "2 kHz", "drives/alone.toml"));
}

fn table() -> String {
    let ranges = [12.5, 30.0, 10.0];
    let drives = [
        ("joint1", "classic", "protocol = \"damiao\"\nnode = 4\nmaster = 0x14"),
        ("joint2", "fast", "protocol = \"moteus\"\nnode = 9"),
        ("joint3", "fast", "protocol = \"moteus\"\nnode = 126"),
    ];
    let drives = drives.map(|(joint, bus, protocol)| arms::drive(joint, bus, protocol, ranges));
    arms::bus("classic", "vcan0", false) + &arms::bus("fast", "vcan1", true) + &drives.concat()
}

#[test]
fn can_fd_drives_are_found_and_not_enabled() {
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
fn can_fd_frames_avoid_interfaces_with_classic_drives() {
    let Some(found) = row("scan_classic") else { return };
    let report = found.report();
    assert_eq!(report["fd_search"]["outcome"], "classic", "{report}");
    assert_eq!((&report["devices"][0]["node"], &report["devices"][1]), (&4.into(), &serde_json::Value::Null));
}

#[test]
fn an_interface_without_can_fd_is_refused() {
    let Some(refused) = row("scan_no_fd") else { return };
    assert_eq!(refused.code, 1, "{refused:?}");
    let said = format!("{} {}", refused.text, refused.errors);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("`vcan1` does not carry CAN FD"), "{refused:?}");
}
