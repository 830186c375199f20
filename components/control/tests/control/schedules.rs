//! The contact schedule of `control.qp`, on a quadruped whose state the test sets.

use std::path::Path;

use motorium::launcher::{Exit, Report};
use motorium::prelude::*;
use motorium::state::{ContactSchedule, ControlDiagnostics};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_control::QpController;
use motorium_robots::{Loaded, load};

use crate::component::number;
use crate::torque::refused;

fn quadruped() -> Loaded {
    load("quadruped", Path::new(".")).unwrap()
}

/// A quadruped standing at home.
fn standing() -> Graph {
    let robot = quadruped();
    let home = robot.profile.unwrap().configuration(&robot.model, "standing").unwrap();
    let joints: Vec<f64> = home.as_slice()[7..].to_vec();
    let base = BaseState {
        position: [home[0], home[1], home[2]],
        orientation: [home[3], home[4], home[5], home[6]],
        ..BaseState::default()
    };
    Graph::new("schedules")
        .robot("robot", "quadruped")
        .with(Source::new("base", "base", move |_| Some(base)).rate("1 kHz"))
        .with(
            Source::new("joints", "joints", move |_| {
                let mut state = JointState::default();
                state.set_count(joints.len());
                state.position_mut().copy_from_slice(&joints);
                Some(state)
            })
            .rate("1 kHz"),
        )
}

fn config(table: &str) -> toml::Value {
    let table: toml::Table = format!("config = {table}").parse().unwrap();
    table["config"].clone()
}

/// Last command of a controller that is to move the body far to the side, so that friction is active. The
/// schedule contains tilted ground, and stops after this time.
fn pushed_on_a_slope(silent_from: f64) -> Vec<f64> {
    let commands = Probe::<JointCommand>::for_topic("command");
    let schedule = Source::new("schedule", "schedule", move |tick| {
        let mut schedule = ContactSchedule::default();
        schedule.set_count(4);
        schedule.load_mut().fill(1.0);
        schedule.ground_normal = [-0.3, 0.0, 1.0];
        (tick.time() < silent_from).then_some(schedule)
    });
    let tasks = "{ inverse_dynamics = {}, tasks = [\
        { cartesian = { name = \"base\", frame = \"base\", target = \"base_target\", gain = 20.0 } }, { posture = { weight = 0.01 } } ] }";
    let robot = quadruped();
    let home = robot.profile.unwrap().configuration(&robot.model, "standing").unwrap();
    let aside = PoseTarget {
        position: [home[0] + 0.5, home[1], home[2]],
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..PoseTarget::default()
    };
    let controller = Instance::of::<QpController>("controller")
        .robot("robot")
        .trigger("joints")
        .subscribe("joint_state", "joints")
        .subscribe("base_state", "base")
        .subscribe("contact_schedule", "schedule")
        .subscribe("base_target", "base_target")
        .publish("joint_command", "command")
        .set("config", config(tasks));
    let report = standing()
        .with(Source::new("body", "base_target", move |_| Some(aside)).rate("1 kHz"))
        .with(schedule.rate("1 kHz"))
        .with(controller)
        .with(&commands)
        .run("1 s")
        .unwrap();
    assert_eq!(report.exit, Exit::Finished);
    let last = commands.values().pop().unwrap();
    last.effort().to_vec()
}

#[test]
fn ground_stays_tilted_after_the_schedule_stops() {
    let apart = |one: &[f64], other: &[f64]| {
        one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
    };
    let (told, silent, never) =
        (pushed_on_a_slope(f64::INFINITY), pushed_on_a_slope(0.5), pushed_on_a_slope(0.0));
    assert!(apart(&told, &never) > 0.5, "friction must be active: {told:?} {never:?}");
    assert!(apart(&told, &silent) < 1e-6, "{told:?} {silent:?}");
}

/// Runs a controller with a schedule that lifts the first foot for half a second and then stops.
fn scheduled() -> (Report, Vec<JointCommand>, Vec<ControlDiagnostics>) {
    let (commands, steps) = (
        Probe::<JointCommand>::for_topic("command").triggered(),
        Probe::<ControlDiagnostics>::for_topic("diagnostics").triggered(),
    );
    let schedule = Source::new("schedule", "schedule", |tick| {
        let mut schedule = ContactSchedule::default();
        schedule.set_count(4);
        schedule.load_mut().fill(1.0);
        if (0.5..1.0).contains(&tick.time()) {
            schedule.load_mut()[0] = 0.0;
        }
        (tick.time() < 1.5).then_some(schedule)
    });
    let tasks = "{ inverse_dynamics = {}, tasks = [\
        { cartesian = { name = \"foot\", frame = \"front_left_foot\", target = \"foot_target\", while_lifted = \"front_left\" } },\
        { cartesian = { name = \"base\", frame = \"base\", target = \"base_target\" } },\
        { posture = { weight = 0.01 } } ] }";
    let controller = Instance::of::<QpController>("controller")
        .robot("robot")
        .trigger("joints")
        .subscribe("joint_state", "joints")
        .subscribe("base_state", "base")
        .subscribe("contact_schedule", "schedule")
        .subscribe("foot_target", "foot_target")
        .subscribe("base_target", "base_target")
        .publish("joint_command", "command")
        .publish("diagnostics", "diagnostics")
        .set("config", config(tasks));
    let robot = quadruped();
    let home = robot.profile.unwrap().configuration(&robot.model, "standing").unwrap();
    let pose = |position: [f64; 3]| PoseTarget {
        position,
        orientation: [0.0, 0.0, 0.0, 1.0],
        ..PoseTarget::default()
    };
    let (foot, base) = (pose([0.2, 0.15, 0.1]), pose([home[0], home[1], home[2]]));
    let report = standing()
        .with(Source::new("foot", "foot_target", move |_| Some(foot)).rate("1 kHz"))
        .with(Source::new("body", "base_target", move |_| Some(base)).rate("1 kHz"))
        .with(schedule.rate("1 kHz"))
        .with(controller)
        .with(&commands)
        .with(&steps)
        .run("2 s")
        .unwrap();
    (report, commands.values(), steps.values())
}

#[test]
fn schedule_lifts_a_foot_until_it_stops() {
    let (report, commands, steps) = scheduled();
    assert_eq!(report.exit, Exit::Finished);
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
    assert_eq!(commands.len(), steps.len());
    let knee = |step: usize| commands[step].effort()[2].abs();
    let other = |step: usize| commands[step].effort()[5].abs();
    let (before, lifted, after, silent) = (400, 800, 1300, 1900);
    // the knee of a lifted leg only carries the leg, while its neighbour carries more
    assert!(knee(lifted) < 0.5 * knee(before), "{} {}", knee(lifted), knee(before));
    assert!(other(lifted) > 1.2 * other(before), "{} {}", other(lifted), other(before));
    assert!((knee(after) - knee(before)).abs() < 1e-6 && (knee(silent) - knee(before)).abs() < 1e-6);
    for (index, step) in steps.iter().enumerate() {
        let counts = step.residual()[0] > 0.0;
        if [before, after, silent].contains(&index) {
            assert!(!counts, "{index}: a standing foot has no task");
        }
    }
    assert!(steps[lifted].residual()[0] > 0.0, "a lifted foot has a task");
    let without = number(&report.results["controller"]["steps_without_fresh_schedule"]);
    assert!((440.0..=460.0).contains(&without), "{without} steps after 50 ms of silence");
}

#[test]
fn task_for_a_lifted_contact_requires_the_contact() {
    let controller = |table: &str| {
        Graph::new("walker").robot("walker", "quadruped").with(
            Instance::of::<QpController>("controller")
                .robot("walker")
                .rate("1 kHz")
                .set("config", config(table)),
        )
    };
    let tasks = "tasks = [{ cartesian = { frame = \"base\", while_lifted = \"left\" } }]";
    let words = ["tasks[0].cartesian.while_lifted", "no contact `left`", "front_left, front_right"];
    refused(controller(&format!("{{ inverse_dynamics = {{}}, {tasks} }}")), &words);
}

#[test]
fn a_contradicting_task_is_named_despite_inactive_ones() {
    let tasks = "{ inverse_dynamics = {}, tasks = [\
        { constraint = { task = { cartesian = { name = \"swing\", frame = \"front_left_foot\", target = \"foot_target\", while_lifted = \"front_left\" } } } },\
        { constraint = { task = { cartesian = { name = \"body\", frame = \"base\", target = \"base_target\", gain = 30.0 } } } },\
        { posture = { weight = 0.01 } } ] }";
    let controller = Instance::of::<QpController>("controller")
        .robot("robot")
        .trigger("joints")
        .subscribe("joint_state", "joints")
        .subscribe("base_state", "base")
        .subscribe("foot_target", "foot_target")
        .subscribe("base_target", "base_target")
        .publish("joint_command", "command")
        .set("config", config(tasks));
    let far =
        PoseTarget { position: [50.0, 0.0, 0.5], orientation: [0.0, 0.0, 0.0, 1.0], ..PoseTarget::default() };
    let report = standing()
        .with(Source::new("foot", "foot_target", move |_| Some(far)).rate("1 kHz"))
        .with(Source::new("body", "base_target", move |_| Some(far)).rate("1 kHz"))
        .with(controller)
        .run("200 ms")
        .unwrap();
    let solver = &report.results["controller"]["solver"];
    let words = solver["first_conflict"].as_str().unwrap_or_else(|| panic!("{solver}"));
    assert!(words.contains("task `body`, row ") && !words.contains("swing"), "{words}");
}
