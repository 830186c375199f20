//! Drives of every protocol in a lockstep graph: adapter, simulated buses and lines, physics.

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Probe, Source};
use motorium_can::{CanAdapter, DriveSimulation};
use motorium_physics::ArticulatedPhysics;
use serde_json::Value;

use super::components::{Folder, GOAL, adapter, command};

/// Protocol with the rate at which its three drives fit on one bus.
struct Case {
    name: &'static str,
    bus: &'static str,
    drive: &'static str,
    first: u8,
    watchdog: &'static str,
    rate: u32,
}

const CASES: [Case; 6] = [
    Case {
        name: "odrive",
        bus: "",
        drive: "protocol = \"odrive\"\nreport_every = \"4 ms\"",
        first: 0,
        watchdog: "60 ms",
        rate: 250,
    },
    Case {
        name: "odrive-torque",
        bus: "",
        drive: "protocol = \"odrive\"\nreport_every = \"2 ms\"\nmode = \"torque\"",
        first: 0,
        watchdog: "60 ms",
        rate: 400,
    },
    Case {
        name: "cia402",
        bus: "",
        drive: "protocol = \"cia402\"\nincrements = 65536.0\nrated_torque = 4.0",
        first: 1,
        watchdog: "60 ms",
        rate: 500,
    },
    Case {
        name: "cia402-torque",
        bus: "",
        drive: "protocol = \"cia402\"\nincrements = 65536.0\nrated_torque = 4.0\nmode = \"torque\"",
        first: 1,
        watchdog: "60 ms",
        rate: 500,
    },
    Case {
        name: "moteus",
        bus: "data_bitrate = 5_000_000",
        drive: "protocol = \"moteus\"",
        first: 1,
        watchdog: "60 ms",
        rate: 1000,
    },
    Case {
        name: "feetech",
        bus: "kind = \"serial\"",
        drive: "protocol = \"feetech\"",
        first: 1,
        watchdog: "0 s",
        rate: 250,
    },
];

impl Case {
    fn table(&self) -> String {
        let mut text = format!("[[bus]]\nname = \"bus0\"\nbitrate = 1_000_000\n{}\n", self.bus);
        for (node, joint) in (self.first..).zip(["joint1", "joint2", "joint3"]) {
            let Self { drive, watchdog, .. } = self;
            // a servo makes at most one turn
            let (ratio, torque, gains) = match self.name {
                "feetech" => ("1.0", "32.0", "{ kp = 320.0, kd = 16.0 }"),
                _ => ("4.0", "8.0", "{ kp = 20.0, kd = 1.0 }"),
            };
            text += &format!(
                "[[drive]]\njoint = \"{joint}\"\nbus = \"bus0\"\nnode = {node}\nwatchdog = \"{watchdog}\"\nratio = {ratio}\n\
                 ranges = {{ position = 12.6, velocity = 30.0, torque = {torque} }}\n\
                 position_loop = {gains}\n{drive}\n"
            );
        }
        // its goals are limited to a turn
        if self.name == "feetech" { text.replace("position = 12.6", "position = 3.1416") } else { text }
    }

    fn graph(&self, folder: &Folder, simulation: &str) -> Graph {
        let rate = self.rate;
        let text = format!(
            r#"
name  = "protocols"
clock = "lockstep"

[robot.arm]
urdf = "planar-3r"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "4 kHz"
subscribe = {{ joint_command = "arm/efforts" }}
publish   = {{ joint_state = "arm/true_state" }}
config    = {{ plant = true, position = [0.3, 0.8, -0.8] }}

[component.drives]
kind      = "can.drive_sim"
robot     = "arm"
trigger   = "arm/true_state"
subscribe = {{ joint_state = "arm/true_state", frames_sent = "can/sent" }}
publish   = {{ joint_command = "arm/efforts", frames_received = "can/received" }}
config    = {{ drives = "drives.toml", {simulation} }}

[component.adapter]
kind      = "can.adapter"
robot     = "arm"
rate      = "{rate} Hz"
subscribe = {{ joint_command = "arm/command", frames_received = "can/received" }}
publish   = {{ joint_state = "arm/state", frames_sent = "can/sent" }}
config    = {{ drives = "drives.toml", allow_no_watchdog = true }}

[safety]
stale_after = "50 ms"
"#
        );
        Graph::from_toml(text)
            .at_path(&folder.0.join("graph.toml"))
            .kind::<ArticulatedPhysics>()
            .kind::<DriveSimulation>()
            .kind::<CanAdapter>()
            .with(Source::new("commands", "arm/command", |_| Some(command())))
    }

    fn run(&self, name: &str, simulation: &str, duration: &str) -> Report {
        let folder = Folder::new(&format!("{}-{name}", self.name), &self.table());
        self.graph(&folder, simulation).run(duration).unwrap()
    }
}

#[test]
fn drives_of_every_protocol_move_an_arm_to_its_goal() {
    for case in &CASES {
        let folder = Folder::new(&format!("{}-closed", case.name), &case.table());
        let states = Probe::<JointState>::for_topic("arm/state");
        let report = case.graph(&folder, "").with(&states).run("3 s").unwrap();
        let result = adapter(&report);
        for count in ["missing_replies", "late_replies", "refused_frames", "stray_frames"] {
            assert_eq!(result[count], 0, "{}: {result}", case.name);
        }
        assert_eq!(
            (&result["tripped"], &result["cycles"]),
            (&Value::from(false), &Value::from(3 * case.rate))
        );
        assert!(result["enabled_in_cycle"].is_u64(), "{}: {result}", case.name);
        let last = states.values().pop().unwrap();
        for (q, goal) in last.position().iter().zip(GOAL) {
            // the drives deflect under the weight of the arm
            assert!((q - goal).abs() < 0.25, "{}: {:?}", case.name, last.position());
        }
        let moved: f64 =
            last.position().iter().zip([0.3, 0.8, -0.8]).map(|(q, start)| (q - start).abs()).sum();
        assert!(moved > 0.01, "{}: {:?}", case.name, last.position());
    }
}

#[test]
fn runs_of_every_protocol_are_identical_without_allocation() {
    for case in &CASES {
        let noisy = r#"jitter = "30 us", loss = 0.0005"#;
        let (one, two) = (case.run("hash-1", noisy, "1 s"), case.run("hash-2", noisy, "1 s"));
        assert!(one.state_hash.is_some());
        assert_eq!(one.state_hash, two.state_hash, "{}", case.name);
        for component in one.components.iter().filter(|component| component.name != "commands") {
            assert_eq!(component.allocations, Some(0), "{}: {}", case.name, component.name);
        }
    }
}

#[test]
fn one_silent_drive_of_any_protocol_trips_the_adapter() {
    for case in &CASES {
        let silent = r#"faults = [{ at = "700 ms", kind = "silent", joint = "joint2" }]"#;
        let report = case.run("silent", silent, "1 s");
        let (result, joint) = (adapter(&report), &adapter(&report)["joints"]["joint2"]);
        assert_eq!((&result["tripped"], &joint["lost"]), (&Value::from(true), &Value::from(1)), "{result}");
        let begun = 7 * u64::from(case.rate) / 10;
        let lost_in = joint["lost_in_cycle"].as_u64().unwrap();
        // an ODrive's report is overdue a cycle later, and its period may be twice a cycle
        assert!((begun + 3..=begun + 6).contains(&lost_in), "{}: cycle {lost_in}, from {begun}", case.name);
        assert_eq!(result["joints"]["joint1"]["missing_replies"], 0, "{}: {result}", case.name);
    }
}

#[test]
fn cut_or_corrupt_answers_of_any_protocol_are_refused() {
    for case in &CASES {
        for kind in ["wrong_length", "corrupt"] {
            let fault = format!(
                r#"faults = [{{ at = "700 ms", lasts = "5 ms", kind = "{kind}", joint = "joint1" }}]"#
            );
            let report = case.run(kind, &fault, "900 ms");
            let joint = &adapter(&report)["joints"]["joint1"];
            assert!(
                joint["refused_frames"].as_u64().is_some_and(|count| count > 0),
                "{} {kind}: {joint}",
                case.name
            );
            let others = &adapter(&report)["joints"]["joint2"];
            assert_eq!(others["refused_frames"], 0, "{} {kind}: {others}", case.name);
        }
    }
}

#[test]
fn faults_of_can_buses_are_refused_on_a_serial_line() {
    let case = &CASES[5];
    let folder = Folder::new("serial-fault", &case.table());
    let babbling = r#"faults = [{ at = "1 s", kind = "babbling", bus = "bus0" }]"#;
    let text = case.graph(&folder, babbling).check().unwrap_err().render(false);
    assert!(text.contains("this kind of fault is only for CAN buses"), "{text}");
}

#[test]
fn an_unplugged_line_loses_all_its_servos() {
    let report =
        CASES[5].run("alone", r#"faults = [{ at = "700 ms", kind = "alone", bus = "bus0" }]"#, "1 s");
    let result = adapter(&report);
    assert_eq!(result["tripped"], true, "{result}");
    for joint in ["joint1", "joint2", "joint3"] {
        assert_eq!(result["joints"][joint]["lost"], 1, "{result}");
    }
    assert_eq!(
        result["buses"]["bus0"]["unacknowledged"], 0,
        "nobody acknowledges on a serial line: {result}"
    );
}
