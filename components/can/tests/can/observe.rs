//! An adapter that only observes: drives of every protocol answer while disabled.

use motorium::prelude::*;
use motorium::testing::{Graph, Probe};
use motorium_can::adapter::{Adapter, OnTrip, Phase};
use motorium_can::odrive::{Node, Report};
use motorium_can::{CanAdapter, DriveSimulation, Frame, JointHealth, Received, Table};
use motorium_physics::ArticulatedPhysics;

use super::components::{Folder, adapter};

/// Protocol name, additional keys of its bus and of its drives, first drive number, and rate at which three
/// drives fit on a bus (Hz).
const PROTOCOLS: [(&str, &str, &str, u8, u32); 10] = [
    ("damiao", "", "", 1, 400),
    ("mini_cheetah", "", "", 1, 400),
    ("mini_cheetah_voltage", "", "", 1, 400),
    ("cubemars", "", "", 1, 400),
    ("robstride", "", "", 1, 400),
    ("odrive", "", "report_every = \"4 ms\"", 0, 250),
    ("cia402", "", "increments = 65536.0\nrated_torque = 4.0", 1, 500),
    ("moteus", "data_bitrate = 5_000_000", "", 1, 1000),
    ("feetech", "kind = \"serial\"", "", 1, 250),
    ("dynamixel", "kind = \"serial\"", "", 1, 100),
];

/// Drives of the arm, with disabled watchdogs, which an adapter that enables them would refuse.
fn table((protocol, bus, drive, first, _): (&str, &str, &str, u8, u32)) -> String {
    let mut text = format!("[[bus]]\nname = \"bus0\"\nbitrate = 1_000_000\n{bus}\n");
    for (node, joint) in (first..).zip(["joint1", "joint2", "joint3"]) {
        text += &format!(
            "[[drive]]\njoint = \"{joint}\"\nbus = \"bus0\"\nprotocol = \"{protocol}\"\nnode = {node}\nwatchdog = \"0 s\"\n\
             ranges = {{ position = 3.1416, velocity = 30.0, torque = 8.0 }}\n{drive}\n"
        );
    }
    text
}

/// Graph whose arm has no brakes and is pushed while the adapter observes.
fn graph(folder: &Folder, rate: u32, more: &str, simulation: &str) -> Graph {
    let text = format!(
        r#"
name  = "observed"
clock = "lockstep"

[robot.arm]
urdf = "planar-3r"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "4 kHz"
subscribe = {{ joint_command = "arm/efforts" }}
publish   = {{ joint_state = "arm/true_state" }}
config    = {{ plant = true, position = [0.3, 0.8, -0.8], pushes = [{{ at = "0 s", duration = "100 ms", link = "link3", force = [0.0, 4.0, 0.0] }}] }}

[component.drives]
kind      = "can.drive_sim"
robot     = "arm"
trigger   = "arm/true_state"
subscribe = {{ joint_state = "arm/true_state", frames_sent = "can/sent" }}
publish   = {{ joint_command = "arm/efforts", frames_received = "can/received" }}
config    = {{ drives = "drives.toml", brakes = false, {simulation} }}

[component.adapter]
kind      = "can.adapter"
robot     = "arm"
rate      = "{rate} Hz"
subscribe = {{ frames_received = "can/received" }}
publish   = {{ joint_state = "arm/state", frames_sent = "can/sent", joint_health = "arm/health" }}
config    = {{ drives = "drives.toml", observe = true, {more} }}
"#
    );
    Graph::from_toml(text)
        .at_path(&folder.0.join("graph.toml"))
        .kind::<ArticulatedPhysics>()
        .kind::<DriveSimulation>()
        .kind::<CanAdapter>()
}

#[test]
fn drives_of_every_protocol_are_measured_while_disabled() {
    for protocol in PROTOCOLS {
        let (name, rate) = (protocol.0, protocol.4);
        let folder = Folder::new(&format!("observed-{name}"), &table(protocol));
        let graph = graph(&folder, rate, "", "");
        let plan = graph.check().unwrap_or_else(|error| panic!("{name}: {}", error.render(false))).plan;
        let component = plan.components.iter().find(|component| component.name == "adapter").unwrap();
        assert!(!component.actuator, "{name}");
        assert!(component.inputs.iter().all(|input| input.port != "joint_command"), "{name}");

        let measured = Probe::<JointState>::for_topic("arm/state");
        let truth = Probe::<JointState>::for_topic("arm/true_state").rate("4 kHz");
        let efforts = Probe::<JointCommand>::for_topic("arm/efforts").rate("4 kHz");
        let health = Probe::<JointHealth>::for_topic("arm/health");
        let graph = graph.with(&measured).with(&truth).with(&efforts).with(&health);
        let report = graph.run("400 ms").unwrap();
        let result = adapter(&report);
        assert_eq!(
            (&result["observes"], &result["tripped"]),
            (&true.into(), &false.into()),
            "{name}: {result}"
        );
        assert!(result["enabled_in_cycle"].is_null(), "{name}: {result}");
        for count in ["missing_replies", "late_replies", "refused_frames", "stray_frames"] {
            assert_eq!(result[count], 0, "{name}: {result}");
        }
        for joint in ["joint1", "joint2", "joint3"] {
            assert_eq!(result["joints"][joint]["phase"], "disabled", "{name}: {result}");
        }
        let is_off = |command: &JointCommand| command.effort().iter().all(|effort| *effort == 0.0);
        assert!(efforts.values().iter().all(is_off), "{name}: no drive applies torque");
        let flags = JointHealth::ENABLED | JointHealth::FAULT | JointHealth::LOST;
        let healths = health.values();
        assert!(healths.iter().all(|health| health.flags.iter().all(|found| found & flags == 0)), "{name}");

        // each state has the age given by its source time
        let truth = truth.samples();
        let last = measured.samples().pop().unwrap_or_else(|| panic!("{name}: no state"));
        let then = truth.iter().rev().find(|sample| sample.time_ns <= last.stamp.source_time).unwrap();
        for joint in 0..3 {
            let (found, expected) = (last.value.position()[joint], then.value.position()[joint]);
            let moved = then.value.velocity()[joint].abs() * 2.0 / f64::from(rate);
            assert!((found - expected).abs() < 3e-3 + moved, "{name}: {found} at {expected}");
        }
        let start = truth[0].value;
        let way = |joint: usize| (last.value.position()[joint] - start.position()[joint]).abs();
        let moved = [0, 1, 2].map(way);
        assert!(moved.iter().sum::<f64>() > 0.1, "{name}: it was moved by {moved:?} rad");
    }
}

#[test]
fn a_silent_drive_is_measured_again_when_it_answers() {
    for protocol in PROTOCOLS {
        let name = protocol.0;
        let folder = Folder::new(&format!("observed-silent-{name}"), &table(protocol));
        let silent = r#"faults = [{ at = "200 ms", lasts = "50 ms", kind = "silent", joint = "joint2" }]"#;
        let measured = Probe::<JointState>::for_topic("arm/state");
        let report = graph(&folder, protocol.4, "", silent).with(&measured).run("600 ms").unwrap();
        let result = adapter(&report);
        assert_eq!(
            (&result["tripped"], &result["joints"]["joint2"]["phase"]),
            (&false.into(), &"disabled".into())
        );
        let times: Vec<u64> =
            measured.samples().iter().map(|sample| sample.stamp.publish_time / 1_000_000).collect();
        assert!(
            !times.iter().any(|ms| (240..250).contains(ms)),
            "{name}: its joint was published while unknown"
        );
        assert!(times.last().is_some_and(|ms| *ms >= 590), "{name}: {times:?}");
    }
}

#[test]
fn observers_refuse_keys_that_require_torque() {
    let refusal = |table: &str, more: &str| {
        let folder = Folder::new("observed-refused", table);
        graph(&folder, 400, more, "").check().unwrap_err().render(false)
    };
    let plain = table(PROTOCOLS[0]);
    let homed =
        plain.clone() + "homing = { by = \"stop\", velocity = -0.5, effort = 1.2, position = -1.0 }\n";
    let found = refusal(&homed, "");
    assert!(found.contains("the drive of `joint3` has to be homed, which needs torque"), "{found}");
    let found = refusal(&plain, "leave_enabled = true");
    assert!(found.contains("with `observe`, no drive is enabled"), "{found}");
    let found = refusal(&plain, "command_within = \"1 ms\"");
    assert!(found.contains("there are no commands to wait for"), "{found}");
    let folder = Folder::new("observed-command", &plain);
    let commanded =
        graph(&folder, 400, "", "").set("component.adapter.subscribe.joint_command", "arm/efforts");
    let found = commanded.check().unwrap_err().render(false);
    assert!(found.contains("has no input `joint_command`"), "{found}");
}

#[test]
fn a_fault_lasts_while_the_drive_reports_it() {
    let text = table(PROTOCOLS[5]).split("[[drive]]").take(2).collect::<Vec<_>>().join("[[drive]]");
    let table = Table::parse(&text).unwrap();
    let mut adapter = Adapter::new(&table, &[0], &[0.1], OnTrip::Damp).observer();
    let node = Node::new(0).unwrap();
    let mut take = |frame: Frame, time_ns: u64| {
        adapter.take(0, &Received { frame, time_ns });
        adapter.end_cycle(true);
        (adapter.links()[0].phase(), adapter.has_tripped())
    };
    let idle = node.report_frame(&Report::Heartbeat {
        error: 0,
        state: motorium_can::odrive::AxisState::Idle,
        result: 0,
    });
    let mut failed = idle;
    failed.data_mut()[0] = 0x40;
    assert_eq!(take(idle, 1_000_000), (Phase::Disabled, false));
    assert_eq!(take(failed, 2_000_000), (Phase::Fault, false));
    assert_eq!(take(idle, 3_000_000), (Phase::Disabled, false));
}
