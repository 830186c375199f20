//! `control.qp` with torques: a Panda in a graph.

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Probe};
use motorium_robots::Dynamics;
use nalgebra::{DVector, Vector3};

use crate::component::number;
use crate::graph::{Targets, bare_controller, controller, graph, run};

const TASKS: &str = "tasks = [{ cartesian = {} }, { posture = { weight = 0.01, gain = 3.0 } }]";

fn torques(rest: &str) -> String {
    format!("{{ inverse_dynamics = {{ {rest} }}, {TASKS} }}")
}

fn reach(config: &str) -> Report {
    run(graph("{}", Targets::default(), controller(config)))
}

#[test]
fn hand_reaches_its_goals_by_torques_without_allocating() {
    let report = reach(&torques(""));
    let result = &report.results["controller"];
    assert_eq!(result["goals_reached"], 2, "{result}");
    assert!(number(&result["position_error_m"]) < 1e-3, "{result}");
    assert_eq!(result["steps_without_solution"], 0);
    assert_eq!(result["solver"]["steps_relaxed"], 0);
    assert!(number(&result["tasks"]["cartesian"]["residual"]["max"]) > 0.0);
    assert_eq!(report.results["plant"]["broken_limits"], 0);
    assert!(report.results["plant"]["kp"].as_array().unwrap().iter().all(|kp| *kp == 0.0));
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
}

#[test]
fn impedance_adds_scaled_gains_to_the_integrated_motion() {
    let report = reach(&torques("impedance = 0.5"));
    let result = &report.results["controller"];
    assert_eq!(result["goals_reached"], 2, "{result}");
    assert!(number(&result["position_error_m"]) < 1e-3, "{result}");
    let gains = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
    let gains = gains.profile.unwrap().gains(&gains.model).unwrap();
    assert_eq!(number(&report.results["plant"]["kp"][0]), 0.5 * gains.kp[0]);
}

#[test]
fn integrated_motions_keep_the_limits_of_the_profile() {
    let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
    let limits = panda.profile.unwrap().acceleration_limit(&panda.model).unwrap();
    // the largest acceleration of a setpoint, in units of the joint's limit
    let hardest = |rest: &str| {
        let probe = Probe::<JointCommand>::for_topic("panda/joint_command").triggered();
        let tasks = "tasks = [{ cartesian = { gain = 60.0 } }, { posture = { weight = 0.01, gain = 3.0 } }]";
        let config = format!("{{ inverse_dynamics = {{ unknowns = \"accelerations\"{rest} }}, {tasks} }}");
        let report = run(graph("{}", Targets::default(), controller(&config)).with(&probe));
        assert_eq!(report.results["controller"]["steps_without_solution"], 0);
        // After `stiff_start`, during which the drives hold their positions.
        let commands = probe.values().split_off(610);
        let accelerations = commands.windows(2).flat_map(|pair| {
            (0..7).map(|joint| {
                (pair[1].velocity()[joint] - pair[0].velocity()[joint]).abs() / 1e-3 / limits[joint]
            })
        });
        accelerations.fold(0.0, f64::max)
    };
    let (limited, free) = (hardest(""), hardest(", max_acceleration = 1000.0"));
    // The integrated velocities are drawn towards the measured ones.
    assert!(limited <= 1.0 && free > 1.1, "{limited} {free}");
}

#[test]
fn same_graph_publishes_identical_torques() {
    let (one, two) = (reach(&torques("")), reach(&torques("")));
    assert!(one.state_hash.is_some());
    assert_eq!(one.state_hash, two.state_hash);
    assert_ne!(one.state_hash, reach(&torques("braking = 1.0")).state_hash);
}

#[test]
fn levels_keep_a_strong_posture_from_disturbing_the_hand() {
    let error = |level: u32| {
        let tasks = format!(
            "tasks = [{{ cartesian = {{}} }}, {{ posture = {{ level = {level}, weight = 1.0, gain = 5.0 }} }}]"
        );
        let report = reach(&format!("{{ inverse_dynamics = {{}}, {tasks} }}"));
        assert_eq!(report.results["controller"]["steps_without_solution"], 0);
        number(&report.results["controller"]["position_error_m"])
    };
    let (sum, below) = (error(1), error(2));
    assert!(sum > 0.02, "{sum}");
    assert!(below < 2e-3, "{below}");
}

#[track_caller]
pub(crate) fn refused(graph: Graph, words: &[&str]) {
    let error = graph.check().expect_err("it must be refused").render(false);
    for words in words {
        assert!(error.contains(words), "no `{words}` in\n{error}");
    }
}

#[test]
fn invalid_torque_configurations_are_refused_by_key() {
    let with = |config: &str| graph("{}", Targets::default(), controller(config));
    refused(with(&torques("contacts = [{ foot = \"left\" }]")), &["contacts[0].foot", "no foot `left`"]);
    refused(with(&torques("contacts = [{ frame = \"panda_hnad\" }]")), &["contacts[0].frame", "panda_hand"]);
    refused(with(&torques("contacts = [{}]")), &["contacts[0]", "either a `foot`"]);
    refused(with(&torques("braking = 0.0")), &["inverse_dynamics.braking"]);
    refused(with(&torques("max_acceleration = 1.0")), &["inverse_dynamics.max_acceleration", "from 20"]);
    refused(with("{ inverse_dynamics = {}, inertia_compensation = true }"), &["inertia_compensation"]);
    refused(with("{ tasks = [{ momentum = {} }] }"), &["tasks[0].momentum", "needs `inverse_dynamics`"]);
    refused(
        with("{ tasks = [{ capture_point = {} }] }"),
        &["tasks[0].capture_point", "needs `inverse_dynamics`"],
    );
    let alone = |unknowns: &str, tasks: &str| {
        with(&format!(
            "{{ inverse_dynamics = {{ contacts = [{{ frame = \"panda_hand\" }}], {unknowns} }}, tasks = [{tasks}] }}"
        ))
    };
    let (forces, accelerations) = ("unknowns = \"forces\"", "unknowns = \"accelerations\"");
    refused(
        alone(forces, "{ posture = {} }"),
        &["tasks[0].posture", "motions of the joints", "the only unknowns are contact forces"],
    );
    refused(
        alone(accelerations, "{ contact_wrench = { contact = \"panda_hand\" } }"),
        &["tasks[0].contact_wrench", "acts on forces", "the only unknowns are accelerations"],
    );
    refused(
        alone("unknowns = \"forces\", braking = 5.0", "{ cartesian = {} }"),
        &["inverse_dynamics.braking", "has no effect"],
    );
    refused(
        alone("unknowns = \"accelerations\", torque_fraction = 0.5", "{ cartesian = {} }"),
        &["inverse_dynamics.torque_fraction", "has no effect"],
    );
    let pressed = "unknowns = \"accelerations\", contacts = [{ frame = \"panda_hand\", sole = [0.1, 0.1], wrench = { min_force = 5.0 } }]";
    refused(
        with(&torques(pressed)),
        &["inverse_dynamics.contacts[0].wrench.min_force", "has no effect", "accelerations_and_forces"],
    );
    for (limit, key) in [
        ("position = { margin = 0.1 }", "position.margin"),
        ("velocity = { fraction = 0.5 }", "velocity.fraction"),
    ] {
        let config = format!(
            "{{ inverse_dynamics = {{ contacts = [{{ frame = \"panda_hand\" }}], {forces} }}, limits = {{ {limit} }} }}"
        );
        refused(with(&config), &[&format!("limits.{key}"), "has no effect", "accelerations_and_forces"]);
    }
    let scaled = bare_controller(
        "{ inverse_dynamics = { unknowns = \"forces\" }, tasks = [{ centre_of_mass = {} }] }",
    );
    let scaled = scaled.robot("walker").subscribe("base_state", "base").parameter("velocity_fraction", 0.5);
    let walker = Graph::new("walker").robot("walker", "quadruped").with(scaled);
    refused(walker, &["no parameter `velocity_fraction`"]);
    refused(with(&torques("unknowns = \"forces\"")), &["inverse_dynamics.unknowns", "without a contact"]);
    let contact = |rest: &str| with(&torques(&format!("contacts = [{{ frame = \"panda_hand\", {rest} }}]")));
    refused(contact("margin = 0.1"), &["contacts[0].margin", "no sole"]);
    refused(contact("sole = [0.3, 0.1], margin = 0.05"), &["contacts[0].margin", "0.05 m leaves nothing"]);
}

#[test]
fn floating_base_requires_torques_and_base_state() {
    let walker = |config: &str| {
        Graph::new("walker").robot("walker", "quadruped").with(bare_controller(config).robot("walker"))
    };
    refused(walker("{}"), &["floating base", "add `inverse_dynamics = {}`"]);
    refused(walker("{ inverse_dynamics = {}, tasks = [{ posture = {} }] }"), &["base_state"]);
}

#[test]
fn accelerations_reach_the_goals_by_positions_or_torques() {
    for (rest, share) in [("", 1.0), (", impedance = 0.0", 0.0)] {
        let report = reach(&torques(&format!("unknowns = \"accelerations\"{rest}")));
        let result = &report.results["controller"];
        assert_eq!(result["goals_reached"], 2, "{result}");
        assert!(number(&result["position_error_m"]) < 1e-3, "{result}");
        assert_eq!(result["steps_without_solution"], 0);
        assert_eq!(report.results["plant"]["broken_limits"], 0);
        let robot = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
        let gains = robot.profile.unwrap().gains(&robot.model).unwrap();
        assert_eq!(number(&report.results["plant"]["kp"][0]), share * gains.kp[0]);
        let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
        assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
    }
}

#[test]
fn held_joints_without_a_solution_only_carry_weight() {
    let config = "{ inverse_dynamics = { on_infeasible = \"hold\", stiff_start = \"0 s\" }, limits = { velocity = { fraction = 0.1 } }, \
                  tasks = [{ constraint = { task = { cartesian = { gain = 20.0 } } } }, { posture = {} }] }";
    let commands = Probe::<JointCommand>::for_topic("panda/joint_command").triggered();
    let states = Probe::<JointState>::for_topic("panda/joint_state").triggered();
    let report = run(graph("{}", Targets::default(), controller(config)).with(&commands).with(&states));
    let unsolved = report.results["controller"]["steps_without_solution"].as_u64().unwrap();
    assert!(unsolved > 100, "{}", report.results["controller"]);
    let robot = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
    let (model, mut dynamics) = (&robot.model, Dynamics::new(&robot.model));
    let mut weight = |q: &[f64]| {
        let mut weight = DVector::zeros(model.nv());
        dynamics.gravity(model, q, Vector3::new(0.0, 0.0, -9.81), weight.as_mut_slice());
        weight
    };
    let (commands, states) = (commands.values(), states.values());
    let (mut held, mut accelerated) = (0, 0);
    for (index, command) in commands.iter().enumerate() {
        // the state from which the command was computed
        let near = &states[index.saturating_sub(2)..(index + 3).min(states.len())];
        let effort = DVector::from_column_slice(command.effort());
        let far = near.iter().map(|state| (&effort - weight(state.position())).amax());
        let far = far.fold(f64::INFINITY, f64::min);
        // held joints use their gains; joints moved by torques have none
        match command.kp()[0] > 0.0 {
            true => {
                assert!(far < 1e-9, "{index}: {far} Nm beyond its weight");
                held += 1;
            }
            false => accelerated += u32::from(far > 0.1),
        }
    }
    assert!(held > 100 && accelerated > 100, "{held} held, {accelerated} accelerated");
}
