//! Components in a lockstep graph: adapter, simulated buses and drives, physics.

use std::path::PathBuf;

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Probe, Source};
use motorium_can::{CanAdapter, DriveSimulation, JointHealth};
use motorium_physics::ArticulatedPhysics;
use serde_json::Value;

pub(super) const DRIVES: &str = r#"
[[bus]]
name    = "can0"
bitrate = 1_000_000

[[drive]]
joint    = "joint1"
bus      = "can0"
protocol = "damiao"
node     = 1
ratio    = 4.0
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 8.0 }

[[drive]]
joint    = "joint2"
bus      = "can0"
protocol = "damiao"
node     = 2
ratio    = 4.0
reversed = true
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 8.0 }

[[bus]]
name    = "can1"
bitrate = 1_000_000

[[drive]]
joint    = "joint3"
bus      = "can1"
protocol = "mini_cheetah"
node     = 3
ratio    = 4.0
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 8.0 }
"#;

/// Folder with the drive table, and the location of a graph file.
pub(super) struct Folder(pub(super) PathBuf);

impl Folder {
    pub(super) fn new(name: &str, drives: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("motorium-can-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("drives.toml"), drives).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Positions at which the joints are held, rad.
pub(super) const GOAL: [f64; 3] = [0.35, 0.75, -0.85];

/// Planar arm that commands hold through its drives, with additions to the tables of the simulated drives and
/// of the safety.
pub(super) fn graph(folder: &Folder, simulation: &str, safety: &str) -> Graph {
    let command = Source::new("commands", "arm/command", |_| Some(command()));
    bare_graph(folder, simulation, safety).kind::<CanAdapter>().with(command)
}

/// Command that holds the arm at its goal.
pub(super) fn command() -> JointCommand {
    let mut command = JointCommand::default();
    command.set_count(3);
    command.position_mut().copy_from_slice(&GOAL);
    command.velocity_mut().fill(0.0);
    command.effort_mut().fill(0.0);
    command.kp_mut().copy_from_slice(&[100.0, 60.0, 20.0]);
    command.kd_mut().copy_from_slice(&[20.0, 8.0, 2.0]);
    command
}

/// Same graph without a commander and without the adapter's kind.
pub(super) fn bare_graph(folder: &Folder, simulation: &str, safety: &str) -> Graph {
    pushed_graph(folder, "pushes = []", simulation, safety)
}

/// Same graph with pushes on the arm.
pub(super) fn pushed_graph(folder: &Folder, pushes: &str, simulation: &str, safety: &str) -> Graph {
    let text = format!(
        r#"
name  = "can"
clock = "lockstep"

[robot.arm]
urdf = "planar-3r"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "4 kHz"
subscribe = {{ joint_command = "arm/efforts" }}
publish   = {{ joint_state = "arm/true_state" }}
config    = {{ plant = true, position = [0.3, 0.8, -0.8], {pushes} }}

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
rate      = "1 kHz"
subscribe = {{ joint_command = "arm/command", frames_received = "can/received" }}
publish   = {{ joint_state = "arm/state", frames_sent = "can/sent", joint_health = "arm/health" }}
config    = {{ drives = "drives.toml" }}

[safety]
{safety}
"#
    );
    Graph::from_toml(text)
        .at_path(&folder.0.join("graph.toml"))
        .kind::<ArticulatedPhysics>()
        .kind::<DriveSimulation>()
}

fn run(name: &str, simulation: &str, duration: &str) -> Report {
    let folder = Folder::new(name, DRIVES);
    graph(&folder, simulation, "").run(duration).unwrap()
}

pub(super) fn adapter(report: &Report) -> &Value {
    &report.results["adapter"]
}

#[test]
fn commands_reach_the_arm_and_no_answer_is_missing() {
    let folder = Folder::new("closed", DRIVES);
    let states = Probe::<JointState>::for_topic("arm/state");
    let report = graph(&folder, "", "").with(&states).run("3 s").unwrap();
    let result = adapter(&report);
    assert_eq!(result["missing_replies"], 0, "{result}");
    assert_eq!((&result["late_replies"], &result["refused_frames"]), (&Value::from(0), &Value::from(0)));
    assert_eq!(result["cycles"], 3000);
    assert!(result["enabled_in_cycle"].as_u64().is_some_and(|cycle| cycle < 10), "{result}");
    let last = states.values().pop().unwrap();
    for (q, goal) in last.position().iter().zip(GOAL) {
        // the drives deflect under the weight of the arm
        assert!((q - goal).abs() < 0.2, "{:?}", last.position());
    }
    assert!(last.position() != [0.3, 0.8, -0.8]);
    let load = result["buses"]["can0"]["load"].as_f64().unwrap();
    assert!(load > 0.40 && load < 0.54, "{load}: two drives of 270 bits at most");
}

#[test]
fn two_runs_are_identical_and_do_not_allocate() {
    let noisy = r#"jitter = "30 us", loss = 0.001"#;
    let (one, two) = (run("hash-1", noisy, "1 s"), run("hash-2", noisy, "1 s"));
    assert!(one.state_hash.is_some());
    assert_eq!(one.state_hash, two.state_hash);
    for component in one.components.iter().filter(|component| component.name != "commands") {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
}

#[test]
fn the_joint_lags_its_motor_by_load_over_stiffness() {
    let soft = r#"actuator = { delay = "1 ms", drivetrain = { motor_inertia = 0.05, stiffness = 120.0, damping = 2.0 } }"#;
    let folder = Folder::new("soft", DRIVES);
    let measured = Probe::<JointState>::for_topic("arm/state");
    let truth = Probe::<JointState>::for_topic("arm/true_state");
    let commands = Source::new("commands", "arm/command", |_| Some(command()));
    let push = r#"pushes = [{ at = "0 s", duration = "10 s", link = "link3", force = [0.0, 12.0, 0.0] }]"#;
    let pushed = pushed_graph(&folder, push, soft, "").kind::<CanAdapter>().with(commands);
    let report = pushed.with(&measured).with(&truth).run("4 s").unwrap();
    assert_eq!(adapter(&report)["missing_replies"], 0, "{}", adapter(&report));
    let drives = report.components.iter().find(|component| component.name == "drives").unwrap();
    assert_eq!(drives.allocations, Some(0));
    let (measured, truth) = (measured.values().pop().unwrap(), truth.values().pop().unwrap());
    for joint in 0..3 {
        let twist = measured.position()[joint] - truth.position()[joint];
        let expected = truth.effort()[joint] / 120.0;
        // within the resolution of 16 bits over 25 rad, at the joint
        assert!((twist - expected).abs() < 2e-4, "joint {joint}: {twist}, {expected}");
    }
    assert!(truth.effort()[0].abs() > 1.0, "the push bends it: {:?}", truth.effort());
    assert_eq!(run("soft-1", soft, "1 s").state_hash, run("soft-2", soft, "1 s").state_hash);
}

#[test]
fn a_silent_drive_is_lost_in_the_third_cycle() {
    for at in [300, 417, 600] {
        let fault = format!(r#"faults = [{{ at = "{at} ms", kind = "silent", joint = "joint2" }}]"#);
        let report = run(&format!("silent-{at}"), &fault, "800 ms");
        let joint = &adapter(&report)["joints"]["joint2"];
        // the query of this cycle is the first unanswered one, which counts as missing a cycle later
        assert_eq!(
            (&joint["lost"], &joint["lost_in_cycle"]),
            (&Value::from(1), &Value::from(at + 4)),
            "{joint}"
        );
        assert_eq!(adapter(&report)["tripped"], true);
        assert_eq!(adapter(&report)["joints"]["joint1"]["missing_replies"], 0);
    }
}

#[test]
fn the_health_of_the_joints_shows_the_lost_one() {
    let folder = Folder::new("health", DRIVES);
    let health = Probe::<JointHealth>::for_topic("arm/health");
    let fault = r#"faults = [{ at = "300 ms", kind = "off", joint = "joint3" }]"#;
    graph(&folder, fault, "").with(&health).run("400 ms").unwrap();
    let last = health.values().pop().unwrap();
    assert_eq!((last.count, last.tripped), (3, 1));
    assert_eq!(last.flags[2] & JointHealth::LOST, JointHealth::LOST);
    assert_eq!(last.flags[0] & (JointHealth::LOST | JointHealth::ENABLED), JointHealth::ENABLED);
    assert!(last.age[2] > 90, "{}", last.age[2]);
}

#[test]
fn answer_faults_are_counted_by_kind() {
    for (kind, count) in [
        ("wrong_length", "refused_frames"),
        ("corrupt", "refused_frames"),
        ("duplicate", "duplicate_replies"),
    ] {
        let fault =
            format!(r#"faults = [{{ at = "300 ms", lasts = "1 ms", kind = "{kind}", joint = "joint1" }}]"#);
        let report = run(kind, &fault, "500 ms");
        let result = adapter(&report);
        assert_eq!(result[count], 1, "{kind}: {result}");
        assert_eq!(result["missing_replies"], u64::from(kind != "duplicate"), "{kind}: {result}");
        assert_eq!(result["tripped"], false, "{kind}");
    }
}

#[test]
fn late_answers_belong_to_their_own_cycle() {
    let late =
        r#"faults = [{ at = "300 ms", lasts = "1 ms", kind = "late", delay = "800 us", joint = "joint1" }]"#;
    let report = run("late", late, "500 ms");
    let result = adapter(&report);
    assert_eq!(
        (&result["late_replies"], &result["missing_replies"]),
        (&Value::from(1), &Value::from(1)),
        "{result}"
    );
}

#[test]
fn bus_off_trips_the_adapter_and_is_counted() {
    let off = r#"faults = [{ at = "300 ms", lasts = "50 ms", kind = "bus_off", bus = "can1" }]"#;
    let report = run("bus-off", off, "500 ms");
    let result = adapter(&report);
    assert_eq!(result["buses"]["can1"]["bus_off"], 1, "{result}");
    assert!(result["buses"]["can1"]["unsent"].as_u64().is_some_and(|unsent| unsent >= 45), "{result}");
    assert_eq!(result["tripped"], true);
}

#[test]
fn a_babbling_node_makes_the_adapter_lose_its_drives() {
    let babbling = r#"faults = [{ at = "300 ms", lasts = "20 ms", kind = "babbling", bus = "can0" }]"#;
    let report = run("babbling", babbling, "500 ms");
    let result = adapter(&report);
    assert_eq!(result["tripped"], true, "{result}");
    assert!(result["stray_frames"].as_u64().is_some_and(|stray| stray > 100), "{result}");
    assert_eq!(result["joints"]["joint3"]["missing_replies"], 0, "the other bus continues");
}

#[test]
fn a_disturbed_bus_retransmits_and_no_answer_is_missing() {
    let disturbed = r#"faults = [{ at = "300 ms", lasts = "2 ms", kind = "disturbed", bus = "can1" }]"#;
    let report = run("disturbed", disturbed, "500 ms");
    assert_eq!(adapter(&report)["missing_replies"], 0, "{}", adapter(&report));
}

#[test]
fn drives_with_other_settings_than_the_table_are_not_enabled() {
    for (set, words) in [
        (
            r#"set = [{ joint = "joint1", watchdog = "0 s" }]"#,
            "the watchdog is off, but the drive table has 20 ms",
        ),
        (r#"set = [{ joint = "joint2", torque = 18.0 }]"#, "TorqueMax is 18, but the drive table has 8"),
    ] {
        let report = run("settings", set, "100 ms");
        let events = serde_json::to_string(&report.events).unwrap();
        assert!(events.contains(words), "{events}");
        let drives = &report.results["drives"]["drives"];
        assert!(
            ["joint1", "joint2", "joint3"].iter().all(|joint| drives[joint]["enabled"] == false),
            "{drives}"
        );
    }
}

#[test]
fn invalid_configurations_are_refused_before_the_run() {
    let refused = |name: &str, drives: &str, simulation: &str| {
        let folder = Folder::new(name, drives);
        graph(&folder, simulation, "").check().unwrap_err().render(false)
    };
    let crowded = DRIVES
        .replace("bus      = \"can1\"", "bus      = \"can0\"")
        .replace("bitrate = 1_000_000", "bitrate = 500_000");
    let text = refused("crowded", &crowded, "");
    assert!(text.contains("do not fit on bus `can0`: 2 x (135 + 135 bits) + 1 x (135 + 115 bits)"), "{text}");
    let text = refused("watchdog", &DRIVES.replacen("\"20 ms\"", "\"0 s\"", 1), "");
    assert!(text.contains("the watchdog of the drive of `joint1` is off"), "{text}");
    let text = refused("short", &DRIVES.replacen("\"20 ms\"", "\"1 ms\"", 1), "");
    assert!(
        text.contains("the drive of `joint1` disables itself after 1ms without a command, but commands are sent every 1ms"),
        "{text}"
    );
    let text = refused("range", &DRIVES.replacen("position = 12.5", "position = 6.0", 1), "");
    assert!(text.contains("the positions of drive `joint1` cover -1.500 to 1.500"), "{text}");
    let text = refused("fault", DRIVES, r#"faults = [{ at = "1 s", kind = "silent", joint = "joint9" }]"#);
    assert!(text.contains("the drive table has no `joint9`"), "{text}");
    let text = refused("actuator", DRIVES, r#"actuators = { joint9 = { lag = "1 ms" } }"#);
    assert!(text.contains("robot `planar-3r` has no joint `joint9`"), "{text}");
}

#[test]
fn duplicate_answers_suggest_two_drives_with_one_number() {
    let fault = r#"faults = [{ at = "300 ms", lasts = "50 ms", kind = "duplicate", joint = "joint1" }]"#;
    let report = run("twins", fault, "500 ms");
    let bus = &adapter(&report)["buses"]["can0"];
    let diagnosis = bus["diagnosis"].as_str().unwrap_or_default();
    assert!(diagnosis.contains("the drive of `joint1`") && diagnosis.contains("two drives"), "{bus}");
    assert_eq!(adapter(&report)["buses"]["can1"]["diagnosis"], Value::Null);
}
