//! Tasks that are switched off and on while the controller runs.

use std::time::Duration;

use motorium::declare::ParameterValue;
use motorium::prelude::*;

use crate::graph::session;

/// Fade duration of a task, s, and duration of a step, s.
const RAMP: f64 = 0.2;
const DT: f64 = 1e-3;

/// Posture that moves the whole arm, in the level below or next to the switched task.
const AWAY: &str = "positions = [0.4, -0.5, -0.3, -2.0, 0.2, 1.8, 0.5, 0.02], gain = 0.5";

/// Returns numbers of the command in each step; parameters change at their times, ms.
fn commands(
    config: &str,
    number: fn(&JointCommand) -> &[f64],
    changes: &[(u64, &str, f64)],
    until: u64,
) -> Vec<Vec<f64>> {
    let mut session = session(config);
    let mut commands = Vec::new();
    for step in 1..=until {
        for (_, parameter, value) in changes.iter().filter(|(at, ..)| *at == step) {
            session.set("controller", parameter, ParameterValue::Float(*value)).unwrap();
        }
        session.step_until(Duration::from_millis(step)).unwrap();
        let command = session.read::<JointCommand>("panda/joint_command").unwrap();
        commands.push(command.map_or(vec![0.0; 8], |command| number(&command.value).to_vec()));
    }
    let report = session.stop();
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
    assert_eq!(report.results["controller"]["steps_without_solution"], 0, "{}", report.results["controller"]);
    commands
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Largest change between consecutive steps in this range of steps.
fn jump(commands: &[Vec<f64>], from: usize, to: usize) -> f64 {
    commands[from..to].windows(2).map(|pair| distance(&pair[0], &pair[1])).fold(0.0, f64::max)
}

/// Asserts that a weight that falls to 0 at 0.5 s and rises again at 1 s changes the command evenly, and
/// abruptly without a ramp.
#[track_caller]
fn assert_fades(tasks: &str, number: fn(&JointCommand) -> &[f64], weight: (&str, f64)) {
    let run = |ramp: &str| {
        let config = format!("{{ task_ramp = \"{ramp}\", {tasks} }}");
        commands(&config, number, &[(500, weight.0, 0.0), (1000, weight.0, weight.1)], 1500)
    };
    let (sudden, even) = (run("0 ms"), run("200 ms"));
    for at in [498, 998] {
        let change = jump(&sudden, at, at + 5);
        assert!(change > 0.02, "the weight must have an effect: {change}");
        // an even change per step is the step's share of the ramp duration; the error grows while the task
        // fades, and with it the requested motion
        let bound = 3.0 * change * DT / RAMP + 2.0 * jump(&even, at - 100, at);
        let found = jump(&even, at, at + 300);
        assert!(found < bound, "{found}, bound {bound}, sudden {change}");
        assert!(bound < 0.1 * change, "the bound must be meaningful: {bound} {change}");
    }
}

fn velocity(command: &JointCommand) -> &[f64] {
    command.velocity()
}

fn effort(command: &JointCommand) -> &[f64] {
    command.effort()
}

#[test]
fn single_task_in_a_level_fades_without_a_jump() {
    let below = format!("{{ posture = {{ level = 2, weight = 1.0, {AWAY} }} }}");
    let tasks = format!("tasks = [{{ centre_of_mass = {{}} }}, {below}]");
    assert_fades(&tasks, velocity, ("centre_of_mass_weight", 1.0));
    // the last level, below which only the regularisation acts
    let tasks = "tasks = [{ centre_of_mass = { shares = [0.0, 0.0, 1.0] } }, ".to_owned() + &below + "]";
    assert_fades(&tasks, velocity, ("posture_weight", 1.0));
    // a sum whose other task is much weaker
    let beside = format!("{{ posture = {{ weight = 1e-3, {AWAY} }} }}");
    let tasks = format!("tasks = [{{ centre_of_mass = {{}} }}, {beside}]");
    assert_fades(&tasks, velocity, ("centre_of_mass_weight", 1.0));
}

#[test]
fn constraints_and_torque_tasks_fade_without_a_jump() {
    let below = format!("{{ posture = {{ level = 2, weight = 1.0, {AWAY} }} }}");
    let tasks = format!("tasks = [{{ constraint = {{ task = {{ centre_of_mass = {{}} }} }} }}, {below}]");
    assert_fades(&tasks, velocity, ("centre_of_mass_weight", 1.0));
    let tasks = format!(
        "inverse_dynamics = {{ stiff_start = \"0 ms\" }}, tasks = [{{ centre_of_mass = {{}} }}, {below}]"
    );
    assert_fades(&tasks, effort, ("centre_of_mass_weight", 1.0));
}

#[test]
fn tasks_that_fade_in_sequence_change_the_velocity_evenly() {
    let tasks = format!(
        "tasks = [{{ centre_of_mass = {{}} }}, {{ relative = {{ level = 2, other = \"panda_link2\" }} }}, \
         {{ posture = {{ level = 3, weight = 1.0, {AWAY} }} }}]"
    );
    let changes = [
        (500, "centre_of_mass_weight", 0.0),
        (560, "relative_position_weight", 0.0),
        (610, "centre_of_mass_weight", 2.0),
        (650, "relative_orientation_weight", 0.0),
        (700, "relative_position_weight", 1.0),
    ];
    let run =
        |ramp: &str| commands(&format!("{{ task_ramp = \"{ramp}\", {tasks} }}"), velocity, &changes, 1200);
    let (sudden, even) = (run("0 ms"), run("200 ms"));
    let (change, found) = (jump(&sudden, 490, 1200), jump(&even, 490, 1200));
    assert!(found < 0.05 * change, "{found}, sudden {change}");
    assert!(distance(&sudden[1199], &even[1199]) < 0.05 * change, "both end at the same velocity");
}
