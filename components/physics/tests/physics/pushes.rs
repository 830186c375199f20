//! Pushes from outside at stated times.

use std::path::PathBuf;

use motorium::graph;
use motorium::launcher::Options;
use motorium::session::run;
use motorium_physics::{ArticulatedSimulator, JointCommand, Options as Engine, Simulator, World};
use motorium_robots::{Dynamics, load};
use nalgebra::{Point3, Vector3};

use crate::component::registry;

fn text(kind: &str, robot: &str, config: &str) -> String {
    format!(
        r#"
name = "push-test"
clock = "lockstep"
seed = 1
[robot.walker]
urdf = "{robot}"
[component.physics]
kind = "{kind}"
robot = "walker"
rate = "1 kHz"
publish = {{ joint_state = "walker/joint_state" }}
subscribe = {{ joint_command = "walker/joint_command" }}
config = {{ {config} }}
[component.driver]
kind = "test.driver"
trigger = "walker/joint_state"
subscribe = {{ state = "walker/joint_state" }}
publish = {{ command = "walker/joint_command" }}
config = {{ offset = 0.0, until = 0, stiffness = 1.0 }}
"#
    )
}

fn check(text: String) -> Result<graph::Checked, graph::GraphError> {
    graph::check(&PathBuf::from("push-test.toml"), text, &[], &registry(), &graph::Machine::detect())
}

#[test]
fn a_push_adds_its_impulse_and_its_moment_about_the_centre_of_mass_in_the_air() {
    let model = load("quadruped", std::path::Path::new(".")).unwrap().model;
    let (shin, mut q) = (model.frame("front_left_foot").unwrap(), model.neutral());
    q[2] = 1.0;
    let mut simulation =
        ArticulatedSimulator::new(model.clone(), World::default(), &q, Engine::default()).unwrap();
    simulation.set_gravity(Vector3::zeros());
    for (command, start) in simulation.commands_mut().iter_mut().zip(&q[7..]) {
        *command = JointCommand::hold(*start, 1e3, 10.0);
    }
    let (force, point) = (Vector3::new(3.0, -2.0, 1.0), Point3::new(0.0, 0.01, 0.02));
    let mut dynamics = Dynamics::new(&model);
    let before = simulation.frame_pose(shin) * point;
    let centre = {
        let mut kinematics = motorium_robots::Kinematics::new(&model);
        kinematics.update(&model, &q);
        kinematics.centre_of_mass(&model).position
    };
    let h = 1e-4;
    for step in 0..20 {
        if step < 10 {
            simulation.apply_force(shin, point, force);
        }
        simulation.step(h).unwrap();
    }
    let momentum = dynamics.momentum(&model, simulation.configuration(), simulation.velocity());
    let impulse = force * (10.0 * h);
    assert!((momentum.linear - impulse).norm() < 1e-3 * impulse.norm(), "{momentum:?}");
    let expected = (before.coords - centre).cross(&impulse);
    assert!((momentum.angular - expected).norm() < 1e-2 * expected.norm(), "{momentum:?}, {expected}");
}

#[test]
fn a_push_of_a_graph_acts_in_its_time_and_not_before_it() {
    let travel = |pushes: &str| {
        let config = format!("world = {{ gravity = [0.0, 0.0, 0.0] }}, {pushes}");
        let checked = check(text("physics.articulated", "quadruped", &config));
        let mut plan = checked.unwrap_or_else(|error| panic!("{error}")).plan;
        plan.duration_ns = Some(500_000_000);
        let report = run(plan, &registry(), &Options::threads(), &mut |_| ()).unwrap();
        report.results["physics"]["base_travel_x_m"].as_f64().unwrap()
    };
    let push = |at: &str| {
        format!(
            "pushes = [{{ at = \"{at}\", duration = \"20 ms\", point = [0.0, 0.0, 0.0], force = [5.0, 0.0, 0.0] }}]"
        )
    };
    assert!(travel("pushes = []").abs() < 1e-6);
    let (early, late) = (travel(&push("100 ms")), travel(&push("300 ms")));
    assert!(early > 1.5 * late && late > 1e-3, "{early} m, {late} m");
    assert!(travel(&push("600 ms")).abs() < 1e-6);
}

#[test]
fn pushes_that_cannot_be_applied_are_refused_by_their_key() {
    let push = |rest: &str| format!("pushes = [{{ at = \"1 s\", {rest} }}]");
    for (kind, robot, rest, expected) in [
        (
            "physics.articulated",
            "quadruped",
            "duration = \"1 s\", link = \"bas\", force = [1.0, 0.0, 0.0]",
            "base",
        ),
        ("physics.articulated", "quadruped", "duration = \"0 s\", force = [1.0, 0.0, 0.0]", "duration"),
        ("physics.articulated", "quadruped", "duration = \"1 s\", force = [inf, 0.0, 0.0]", "force"),
        ("physics.rapier", "panda", "duration = \"1 s\", force = [1.0, 0.0, 0.0]", "physics.articulated"),
    ] {
        let error = check(text(kind, robot, &push(rest))).map(|_| ()).unwrap_err().render(false);
        assert!(error.contains(expected) && error.contains("pushes"), "{rest}: {error}");
    }
}
