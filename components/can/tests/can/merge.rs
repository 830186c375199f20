//! One robot on two adapters with different rates: an arm on CAN at 1 kHz, and its gripper on a line of
//! servos at 200 Hz. `joint.merge` merges their states.

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Probe, Source};
use motorium_can::{CanAdapter, DriveSimulation};
use motorium_physics::ArticulatedPhysics;
use motorium_sensors::JointMerge;

use super::components::Folder;

const ARM: &str = r#"
[[bus]]
name    = "can0"
bitrate = 1_000_000

[[drive]]
joint    = "joint1"
bus      = "can0"
protocol = "damiao"
node     = 1
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 20.0 }

[[drive]]
joint    = "joint2"
bus      = "can0"
protocol = "damiao"
node     = 2
watchdog = "20 ms"
ranges   = { position = 12.5, velocity = 30.0, torque = 20.0 }
"#;

const GRIPPER: &str = r#"
[[bus]]
name    = "line0"
kind    = "serial"
bitrate = 1_000_000

[[drive]]
joint         = "joint3"
bus           = "line0"
protocol      = "feetech"
node          = 1
watchdog      = "0 s"
ranges        = { position = 3.1416, velocity = 6.0, torque = 3.0 }
position_loop = { kp = 30.0, kd = 1.0 }
"#;

/// Chain of links with these joints.
fn urdf(name: &str, joints: &[&str]) -> String {
    let mut text = format!("<robot name=\"{name}\">\n<link name=\"{name}0\"/>\n");
    for (index, joint) in joints.iter().enumerate() {
        let child = index + 1;
        text += &format!(
            "<link name=\"{name}{child}\"><inertial><origin xyz=\"0 0 0.05\"/><mass value=\"0.4\"/>\
             <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>\n\
             <joint name=\"{joint}\" type=\"revolute\"><parent link=\"{name}{index}\"/><child link=\"{name}{child}\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-2.5\" upper=\"2.5\" velocity=\"3\" effort=\"3\"/></joint>\n"
        );
    }
    text + "</robot>\n"
}

/// Components of one part of the robot: physics, drives and adapter.
fn part(robot: &str, rate: u32, adapter: &str, drives: &str) -> String {
    format!(
        r#"
[component.{robot}_physics]
kind      = "physics.articulated"
robot     = "{robot}"
rate      = "4 kHz"
subscribe = {{ joint_command = "{robot}/efforts" }}
publish   = {{ joint_state = "{robot}/true_state" }}
config    = {{ plant = true }}

[component.{robot}_drives]
kind      = "can.drive_sim"
robot     = "{robot}"
trigger   = "{robot}/true_state"
subscribe = {{ joint_state = "{robot}/true_state", frames_sent = "{robot}/sent" }}
publish   = {{ joint_command = "{robot}/efforts", frames_received = "{robot}/received" }}
config    = {{ drives = "{robot}-drives.toml", {drives} }}

[component.{robot}_adapter]
kind      = "can.adapter"
robot     = "{robot}"
rate      = "{rate} Hz"
subscribe = {{ joint_command = "{robot}/command", frames_received = "{robot}/received" }}
publish   = {{ joint_state = "{robot}/state", frames_sent = "{robot}/sent" }}
config    = {{ drives = "{robot}-drives.toml", {adapter} }}
"#
    )
}

fn command(joints: usize) -> impl FnMut(&Tick) -> Option<JointCommand> {
    move |tick| {
        let mut command = JointCommand::default();
        command.set_count(joints);
        // the joints move continuously, so each measured state differs from the others
        let position = 0.3 * (2.0 * tick.time()).sin();
        command.position_mut().fill(position);
        command.velocity_mut().fill(0.6 * (2.0 * tick.time()).cos());
        command.effort_mut().fill(0.0);
        command.kp_mut().fill(20.0);
        command.kd_mut().fill(1.0);
        Some(command)
    }
}

/// Report and states of arm, gripper and whole robot, with faults of the gripper's drives.
type Recorded = (Report, [Probe<JointState>; 3]);

fn run(name: &str, faults: &str) -> Recorded {
    let folder = Folder::new(name, "");
    let put = |file: &str, text: &str| std::fs::write(folder.0.join(file), text).unwrap();
    put("arm.urdf", &urdf("arm", &["joint1", "joint2"]));
    put("gripper.urdf", &urdf("gripper", &["joint3"]));
    put("whole.urdf", &urdf("whole", &["joint1", "joint2", "joint3"]));
    put("arm-drives.toml", ARM);
    put("gripper-drives.toml", GRIPPER);
    let graph = format!(
        r#"
name  = "two-adapters"
clock = "lockstep"

[robot.whole]
urdf = "whole.urdf"

[robot.arm]
urdf = "arm.urdf"

[robot.gripper]
urdf = "gripper.urdf"
{}{}
[component.merge]
kind      = "joint.merge"
robot     = "whole"
rate      = "500 Hz"
subscribe = {{ arm = "arm/state", gripper = "gripper/state" }}
publish   = {{ joint_state = "whole/state" }}

[component.merge.config.parts]
arm     = {{ joints = ["joint1", "joint2"], stale_after = "4 ms" }}
gripper = {{ joints = ["joint3"], stale_after = "25 ms" }}

[safety]
stale_after = "50 ms"
"#,
        part("arm", 1000, "", ""),
        part("gripper", 200, "allow_no_watchdog = true", faults)
    );
    let topics = ["arm/state", "gripper/state", "whole/state"];
    let probes = topics.map(|topic| Probe::<JointState>::for_topic(topic).triggered());
    let mut graph = Graph::from_toml(graph)
        .at_path(&folder.0.join("graph.toml"))
        .kind::<ArticulatedPhysics>()
        .kind::<DriveSimulation>()
        .kind::<CanAdapter>()
        .kind::<JointMerge>()
        .with(Source::new("arm-commands", "arm/command", command(2)))
        .with(Source::new("gripper-commands", "gripper/command", command(1)));
    for probe in &probes {
        graph = graph.with(probe);
    }
    (graph.run("1 s").unwrap(), probes)
}

#[test]
fn the_merged_state_has_its_rate_and_the_oldest_age() {
    let (report, [arm, gripper, whole]) = run("two-adapters", "");
    let (arm, gripper, whole) = (arm.samples(), gripper.samples(), whole.samples());
    let counts = [arm.len(), gripper.len(), whole.len()];
    assert!((980..=1000).contains(&counts[0]) && (185..=200).contains(&counts[1]), "{counts:?}");
    assert!((470..=500).contains(&counts[2]), "{counts:?}");
    for sample in &whole {
        let now = sample.stamp.publish_time;
        let newest = |part: &[motorium::testing::Sample<JointState>]| {
            *part.iter().rev().find(|part| part.stamp.publish_time <= now).expect("a part")
        };
        let is_from = |part: &[motorium::testing::Sample<JointState>], joints: core::ops::Range<usize>| {
            // a state published exactly at the time of the step may be included or not
            part.iter().any(|part| {
                part.stamp.publish_time + 5_500_000 > now
                    && part.value.position() == &sample.value.position()[joints.clone()]
            })
        };
        assert!(is_from(&arm, 0..2) && is_from(&gripper, 2..3), "at {now}: {:?}", sample.value.position());
        let oldest = newest(&arm).stamp.source_time.min(newest(&gripper).stamp.source_time);
        // possibly the state of the gripper's previous cycle
        assert!(sample.stamp.source_time <= oldest && sample.stamp.source_time + 5_000_000 >= oldest);
        let age_ns = now - sample.stamp.source_time;
        assert!((1_000_000..=11_000_000).contains(&age_ns), "{age_ns}");
    }
    // each state of the slow part occurs in two or three merged states, and each state of the fast part in
    // one; slow motion hides its steps
    let changes = |joint: usize| {
        whole
            .windows(2)
            .filter(|pair| pair[0].value.position()[joint] != pair[1].value.position()[joint])
            .count()
    };
    assert!(changes(0) > 350, "{}", changes(0));
    assert!((110..=200).contains(&changes(2)), "{}", changes(2));
    let result = &report.results["merge"];
    assert_eq!(result["published"].as_u64(), Some(counts[2] as u64), "{result}");
    assert!(result["oldest_ms"]["arm"].as_f64().is_some_and(|age| age < 3.0), "{result}");
    assert!(
        result["oldest_ms"]["gripper"].as_f64().is_some_and(|age| (4.0..11.0).contains(&age)),
        "{result}"
    );
}

#[test]
fn a_stale_part_silences_the_merged_state() {
    let faults = r#"faults = [{ at = "500 ms", kind = "silent", joint = "joint3" }]"#;
    let (report, [arm, gripper, whole]) = run("two-adapters-silent", faults);
    let last = |samples: Vec<motorium::testing::Sample<JointState>>| samples.last().expect("one").stamp;
    let (arm, gripper, whole) = (last(arm.samples()), last(gripper.samples()), last(whole.samples()));
    assert!(arm.publish_time - whole.publish_time > 400_000_000, "the arm continues");
    // no earlier than the measurement is stale, and at most one step later
    let age_ns = whole.publish_time - gripper.source_time;
    assert!((20_000_000..=25_000_000).contains(&age_ns), "{age_ns}");
    let result = &report.results["merge"];
    assert!(result["withheld"].as_u64().is_some_and(|withheld| withheld > 200), "{result}");
    assert!(result["stale"]["gripper"].as_u64() > result["stale"]["arm"].as_u64(), "{result}");
    assert_eq!(report.results["gripper_adapter"]["tripped"], true);
    assert_eq!(report.results["arm_adapter"]["tripped"], false);
}
