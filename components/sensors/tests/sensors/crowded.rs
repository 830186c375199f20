//! More contact points than a message holds: excess points are merged and counted; forces, moments and
//! impulses stay complete.

use std::fmt::Write;
use std::path::Path;

use motorium::prelude::*;
use motorium::state::{ContactImpulses, Contacts};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_physics::ArticulatedPhysics;

/// A table of 13.1 kg with a flag, standing on 20 feet, each a box with four corners on the ground.
fn table() -> String {
    let mut feet = String::new();
    for foot in 0..20 {
        let (x, y) = (0.2 * f64::from(foot % 5), 0.2 * f64::from(foot / 5));
        let _ = write!(
            feet,
            r#"<collision><origin xyz="{x} {y} 0.05"/><geometry><box size="0.05 0.05 0.1"/></geometry></collision>"#
        );
    }
    format!(
        r#"<robot name="table"><link name="top"><inertial><origin xyz="0.4 0.3 0.1"/><mass value="13"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{feet}</link>
  <link name="flag"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="pole" type="continuous"><parent link="top"/><child link="flag"/><origin xyz="0.4 0.3 0.5"/>
  <axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint></robot>"#
    )
}

#[test]
fn contacts_beyond_message_capacity_are_counted() {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("crowded.urdf");
    std::fs::write(&file, table()).unwrap();
    let physics = Instance::of::<ArticulatedPhysics>("physics")
        .rate("1 kHz")
        .robot("r")
        .subscribe("joint_command", "r/command")
        .publish("joint_state", "r/state")
        .publish("base_state", "r/base")
        .publish("contacts", "r/contacts")
        .publish("contact_impulses", "r/impulses")
        .set(
            "config",
            "floating = true\nworld = { ground = {} }\nbase = { position = [0.0, 0.0, 0.0] }"
                .parse::<toml::Table>()
                .map(toml::Value::Table)
                .unwrap(),
        );
    let still = Source::new("still", "r/command", |_| {
        let mut command = JointCommand::default();
        command.set_count(1);
        command.kd_mut().fill(0.1);
        Some(command)
    });
    let (contacts, impulses) =
        (Probe::<Contacts>::for_topic("r/contacts"), Probe::<ContactImpulses>::for_topic("r/impulses"));
    let graph = Graph::new("crowded").robot("r", file.to_str().unwrap()).with(still).with(physics);
    let report = graph.with(&contacts).with(&impulses).run("500 ms").unwrap();
    let last = contacts.values().last().copied().unwrap();
    assert_eq!((last.count(), last.cut), (64, 16));
    let sums = impulses.values();
    let upwards = |sums: &ContactImpulses| sums.impulse_z().iter().sum::<f64>();
    let [before, after] = [sums[sums.len() - 101], sums[sums.len() - 1]];
    let force = (upwards(&after) - upwards(&before)) / 0.1;
    assert!((force - 13.1 * 9.81).abs() < 0.1 && after.cut == 0, "{force} N");
    let whole: f64 = last.force_z().iter().sum();
    assert!((whole - 13.1 * 9.81).abs() < 0.1, "{whole} N");
    let about_y: f64 = (0..64)
        .map(|index| {
            last.position_z()[index] * last.force_x()[index]
                - last.position_x()[index] * last.force_z()[index]
        })
        .sum();
    let moment = (after.moment_y()[0] - before.moment_y()[0]) / 0.1;
    assert!(moment < -40.0 && (about_y - moment).abs() < 0.1, "{about_y} N m, by impulses {moment} N m");
    let result = &report.results["physics"];
    assert!(result["contacts_left_out"].as_u64().unwrap() >= 16 * 400);
    let row = &result["contacts"][0];
    assert_eq!((row["link"].as_str(), row["other"].as_str()), (Some("top"), Some("ground")));
    assert!((row["force"][2].as_f64().unwrap() - 13.1 * 9.81).abs() < 0.1, "{row}");
}
