//! Components in real time over unix sockets, where a controller answers each state with a command.

use motorium::prelude::*;
use motorium::testing::{Function, Graph, machine};
use motorium_can::{CanAdapter, DriveSimulation};
use motorium_physics::ArticulatedPhysics;
use serde_json::Value;

use super::components::{DRIVES, Folder, adapter, command};

/// Result of a 20 Hz adapter with this configuration.
fn run(name: &str, config: &str) -> Value {
    // long watchdogs tolerate a busy machine, because the test only concerns the order of a step
    let drives = DRIVES.replace("\"20 ms\"", "\"5 s\"");
    let folder = Folder::new(name, &drives);
    let place = |bus: &str| format!("{bus} = \"unix:{name}-{bus}-{}\"", std::process::id());
    let interfaces = format!("{{ {}, {} }}", place("can0"), place("can1"));
    let text = format!(
        r#"
name  = "real-time"
clock = "realtime"

[robot.arm]
urdf = "planar-3r"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "1 kHz"
subscribe = {{ joint_command = "arm/efforts" }}
publish   = {{ joint_state = "arm/true_state" }}
config    = {{ plant = true, position = [0.3, 0.8, -0.8] }}

[component.drives]
kind      = "can.drive_sim"
robot     = "arm"
rate      = "1 kHz"
subscribe = {{ joint_state = "arm/true_state" }}
publish   = {{ joint_command = "arm/efforts" }}
config    = {{ drives = "drives.toml", interfaces = {interfaces} }}

[component.adapter]
kind      = "can.adapter"
robot     = "arm"
rate      = "20 Hz"
subscribe = {{ joint_command = "arm/command" }}
publish   = {{ joint_state = "arm/state" }}
config    = {{ drives = "drives.toml", interfaces = {interfaces}, {config} }}

[safety]
stale_after = "5 s"
"#
    );
    let answer = |_: &Tick, _: Option<&JointState>| Some(command());
    let controller = Function::new("commands", "arm/state", "arm/command", answer).trigger("arm/state");
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let graph = Graph::from_toml(text)
        .at_path(&folder.0.join("graph.toml"))
        .kind::<ArticulatedPhysics>()
        .kind::<DriveSimulation>()
        .kind::<CanAdapter>()
        .with(controller);
    let report = graph.run("4 s").unwrap();
    adapter(&report).clone()
}

/// Median time from a command to its frames, us, in a run in which the drives followed for a while. On a
/// machine too busy to receive all answers, the adapter rightly trips.
fn median(name: &str, config: &str) -> f64 {
    let mut runs = (0..5).map(|turn| run(&format!("{name}-{turn}"), config));
    let followed = |result: &Value| result["command_to_frame_us"]["count"].as_u64() >= Some(20);
    let result = runs.find(followed).expect("a run in which the drives follow");
    result["command_to_frame_us"]["p50"].as_f64().expect("a number")
}

#[test]
fn a_waiting_step_sends_its_command_immediately() {
    let (at_once, later) = (median("at-once", "command_within = \"20 ms\""), median("later", ""));
    assert!(at_once < later / 2.0, "{at_once} us and {later} us");
}
