//! Actuators that are commanded at different rates in one graph.

use motorium::prelude::*;
use motorium::testing::{Graph, Source};
use motorium_physics::ArticulatedPhysics;

/// Time after which no commands are sent, ns.
const SILENT_NS: u64 = 500_000_000;

/// A command without a setpoint, only damping.
fn command(joints: usize) -> JointCommand {
    let mut command = JointCommand::default();
    command.set_count(joints);
    command.kd_mut().fill(0.1);
    command
}

/// An arm commanded at 1 kHz and a base at 50 Hz, with this table for the base.
fn graph(safety: &str) -> Graph {
    let actuator = |name: &str| {
        format!(
            "[component.{name}]\nkind = \"physics.articulated\"\nrobot = \"{name}\"\nrate = \"1 kHz\"\n\
             subscribe = {{ joint_command = \"{name}/command\" }}\npublish = {{ joint_state = \"{name}/state\" }}\n"
        )
    };
    let text = format!(
        "name = \"two-rates\"\nclock = \"lockstep\"\n[world]\nground = {{ friction = 0.8 }}\n\
         [robot.arm]\nurdf = \"planar-3r\"\n[robot.base]\nurdf = \"differential-drive\"\n\
         [safety]\nstale_after = \"5 ms\"\n{}{}{safety}",
        actuator("arm"),
        actuator("base")
    );
    let source = |name: &str, joints| {
        let topic = format!("{name}/command");
        let next = move |tick: &Tick| (tick.time_ns < SILENT_NS).then(|| command(joints));
        Source::new(&format!("{name}-commands"), &topic, next)
    };
    Graph::from_toml(text)
        .kind::<ArticulatedPhysics>()
        .with(source("arm", 3))
        .with(source("base", 2).rate("50 Hz"))
}

/// Steps of the arm and of the base in the safe state within a second.
fn safe_steps(safety: &str) -> [u64; 2] {
    let report = graph(safety).run("1 s").unwrap();
    ["arm", "base"].map(|name| report.results[name]["steps_in_safe_state"].as_u64().unwrap())
}

#[test]
fn a_base_at_50_hz_and_an_arm_at_1_khz_share_a_graph() {
    let [arm, base] = safe_steps("[component.base.safety]\nstale_after = \"60 ms\"\n");
    // after the last command of the arm at 499 ms, and of the base at 480 ms
    assert!((494..=498).contains(&arm), "{arm}");
    assert!((458..=462).contains(&base), "{base}");
    let [same, stale] = safe_steps("");
    assert_eq!(same, arm, "the table of another actuator changes nothing");
    assert!(stale > 800, "with the graph's 5 ms the base would stop between two commands: {stale}");
}

#[test]
fn command_stale_before_its_successor_is_rejected() {
    let refused =
        graph("[component.base.safety]\nstale_after = \"10 ms\"\n").check().unwrap_err().render(false);
    assert!(refused.contains("commands of `base` become stale before the next command arrives"), "{refused}");
    assert!(refused.contains("10 ms, shorter than 20 ms"), "{refused}");
}
