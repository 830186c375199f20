//! Several robots in one simulation: each moves as if alone until they touch, and each has a separate command
//! gate.

use std::path::PathBuf;

use motorium::graph;
use motorium::launcher::{Options as RunOptions, Report};
use motorium::session::run;
use motorium_physics::{ArticulatedSimulator, JointSetpoint, Options, RobotSetup, Simulator, World};
use motorium_robots::{Model, Placed};
use nalgebra::Isometry3;

use crate::component::registry;
use crate::panda;

/// Poses of two bases that face each other at distance `apart` \[m\].
fn bases(apart: f64) -> [Isometry3<f64>; 2] {
    let turned = Isometry3::rotation(nalgebra::Vector3::z() * core::f64::consts::PI);
    [Isometry3::identity(), Isometry3::translation(apart, 0.0, 0.0) * turned]
}

/// Two Pandas at home, as one model.
fn two(apart: f64) -> ArticulatedSimulator {
    let panda = panda::loaded().model;
    let placements = bases(apart);
    let placed = ["left/", "right/"].into_iter().zip(placements).map(|(prefix, placement)| Placed {
        model: &panda,
        prefix,
        placement,
    });
    let model = Model::world("two", &placed.collect::<Vec<_>>()).unwrap();
    let q = [panda::home(), panda::home()].concat();
    ArticulatedSimulator::new(RobotSetup::from(model), World::default(), &q, Options::default()).unwrap()
}

/// Commands at `time` \[s\] that move both arms along different paths: forwards up to `reach`, sideways up to
/// `sway` \[rad\].
fn commands(time: f64, reach: f64, sway: f64) -> [Vec<JointSetpoint>; 2] {
    [1.0, 0.7].map(|share| {
        let mut q = panda::home();
        let lean = reach * share * (1.0 - (2.0 * time).cos()) / 2.0;
        q[1] += lean;
        q[3] += lean;
        q[0] += sway * share * (3.0 * time).sin();
        panda::hold(&q)
    })
}

#[test]
fn two_arms_that_do_not_touch_move_as_if_alone() {
    let mut both = two(2.5);
    let panda = panda::loaded().model;
    let mut alone = bases(2.5).map(|base| {
        let model = panda.placed(&base);
        ArticulatedSimulator::new(model, World::default(), &panda::home(), Options::default()).unwrap()
    });
    let drives = panda.joint_count();
    for step in 0..2000 {
        let commands = commands(f64::from(step) * 1e-3, 0.3, 0.2);
        both.commands_mut().copy_from_slice(&commands.concat());
        both.step(1e-3).unwrap();
        for (arm, (single, commands)) in alone.iter_mut().zip(&commands).enumerate() {
            single.commands_mut().copy_from_slice(commands);
            single.step(1e-3).unwrap();
            let of_both = &both.positions()[arm * drives..(arm + 1) * drives];
            for (joint, (a, b)) in of_both.iter().zip(single.positions()).enumerate() {
                assert!((a - b).abs() < 1e-9, "arm {arm}, joint {joint}, step {step}: {a} and {b}");
            }
        }
    }
    let moved = (both.positions()[1] - panda::home()[1]).abs();
    assert!(moved > 0.05, "they moved: {moved}");
}

#[test]
fn two_colliding_arms_push_each_other() {
    let mut both = two(0.9);
    let (mut touched, mut deepest): (bool, f64) = (false, 0.0);
    for step in 0..2000 {
        both.commands_mut().copy_from_slice(&commands(f64::from(step) * 1e-3, 0.9, 0.0).concat());
        both.step(1e-3).unwrap();
        both.visit_contacts(&mut |contact| {
            let between = contact.first.starts_with("left/") && contact.second.starts_with("right/")
                || contact.first.starts_with("right/") && contact.second.starts_with("left/");
            touched |= between && contact.force > 1.0;
            deepest = deepest.max(contact.depth);
        });
    }
    assert!(touched, "the arms reach through one another");
    assert!(deepest < 0.02, "they overlap by {deepest} m");
}

fn graph_text(safety: &str, until: u64) -> String {
    let arm = |name: &str, until: u64| {
        format!(
            r#"
[component.{name}-driver]
kind = "test.driver"
trigger = "{name}/joint_state"
subscribe = {{ state = "{name}/joint_state" }}
publish = {{ command = "{name}/joint_command" }}
config = {{ offset = 0.1, until = {until}, stiffness = 2000.0 }}
"#
        )
    };
    let arms = arm("left", 100_000) + &arm("right", until);
    format!(
        r#"
name = "several-robots"
clock = "lockstep"

[world]
ground = {{ height = -0.5 }}
objects = [{{ name = "table", shape = {{ box = {{ size = [0.2, 0.2, 0.02] }} }}, position = [2.0, 0.0, 0.0] }}]

[robot.left]
urdf = "panda"
base = {{ position = [0.0, 0.6, 0.0] }}

[robot.right]
urdf = "panda"
base = {{ position = [0.0, -0.6, 0.0], rpy = [0.0, 0.0, 1.5] }}

[component.physics]
kind = "physics.articulated"
robots = ["left", "right"]
rate = "1 kHz"
subscribe = {{ "left.joint_command" = "left/joint_command", "right.joint_command" = "right/joint_command" }}
publish = {{ "left.joint_state" = "left/joint_state", "right.joint_state" = "right/joint_state" }}
{arms}
[safety]
stale_after = "5 ms"
safe_state = "hold"
{safety}
"#
    )
}

fn check(text: String) -> Result<graph::Checked, graph::GraphError> {
    graph::check(&PathBuf::from("several-robots.toml"), text, &[], &registry(), &graph::Machine::detect())
}

fn run_for_a_second(safety: &str) -> Report {
    let mut plan =
        check(graph_text(safety, 300)).unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    plan.duration_ns = Some(1_000_000_000);
    let options = RunOptions::threads();
    run(plan, &registry(), &options, &mut |_| ()).unwrap()
}

/// Steps in the safe state of the left and of the right arm.
fn safe(report: &Report) -> [u64; 2] {
    let robots = &report.results["physics"]["robots"];
    ["left", "right"].map(|name| robots[name]["steps_in_safe_state"].as_u64().unwrap())
}

#[test]
fn an_arm_without_commands_stops_alone_or_with_the_other() {
    let alone = run_for_a_second("");
    let [left, right] = safe(&alone);
    assert!(left < 10 && right > 650, "left {left}, right {right}");
    let physics = alone.components.iter().find(|component| component.name == "physics").unwrap();
    assert_eq!(physics.allocations, Some(0));
    let driver = &alone.results["left-driver"];
    let (start, last) = (driver["start"][1].as_f64().unwrap(), driver["last"][1].as_f64().unwrap());
    assert!((last - start - 0.1).abs() < 0.02, "the left arm continues: {start} to {last}");

    let together = run_for_a_second("stop_together = true");
    let [left, right] = safe(&together);
    assert!(left > 650 && right > 650, "left {left}, right {right}");
}

#[test]
fn invalid_settings_of_several_robots_are_found_early() {
    let good = graph_text("", 300);
    for (from, to, expected) in [
        ("robots = [\"left\", \"right\"]", "robots = [\"left\", \"left\"]", "`robots` names `left` twice"),
        ("robots = [\"left\", \"right\"]", "robots = [\"left\", \"up\"]", "no robot named `up`"),
        ("robots = [\"left\", \"right\"]", "robots = []", "`robots` is empty"),
        ("robots = [", "robot = \"left\"\nrobots = [", "both `robot` and `robots`"),
        (
            "[component.left-driver]",
            "[component.left-driver]\nrobots = [\"left\"]",
            "supports at most one robot",
        ),
        ("rate = \"1 kHz\"", "rate = \"1 kHz\"\nconfig = { position = [0.0] }", "start.NAME.position"),
        (
            "rate = \"1 kHz\"",
            "rate = \"1 kHz\"\nconfig = { start = { up = {} } }",
            "`up` is not one of the robots",
        ),
        ("rate = \"1 kHz\"", "rate = \"1 kHz\"\nconfig = { world = {} }", "has its own world"),
        ("ground = {", "grund = {", "unknown key `grund`"),
        ("height = -0.5", "friction = -0.5", "`friction` is -0.5"),
        ("\"left.joint_command\" =", "\"joint_command\" =", "no input `joint_command`"),
        ("position = [0.0, 0.6, 0.0]", "position = [0.0, 0.6]", "not a list of three finite numbers"),
    ] {
        assert!(good.contains(from), "{from}");
        let error = check(good.replacen(from, to, 1)).expect_err(to);
        let text = error.render(false);
        assert!(text.contains(expected), "{to}:\n{text}");
    }
}
