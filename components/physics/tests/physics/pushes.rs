//! External pushes at specified times.

use std::path::PathBuf;

use motorium::graph;
use motorium::launcher::Options;
use motorium::session::run;
use motorium_physics::{
    ArticulatedSimulator, JointSetpoint, Options as Engine, RapierSimulator, Simulator, World,
};
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
fn a_push_adds_its_impulse_and_moment() {
    let model = load("quadruped", std::path::Path::new(".")).unwrap().model;
    let (shin, mut q) = (model.frame("front_left_foot").unwrap(), model.neutral());
    q[2] = 1.0;
    let mut simulation =
        ArticulatedSimulator::new(model.clone(), World::default(), &q, Engine::default()).unwrap();
    simulation.set_gravity(Vector3::zeros());
    for (command, start) in simulation.commands_mut().iter_mut().zip(&q[7..]) {
        *command = JointSetpoint::hold(*start, 1e3, 10.0);
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
fn graph_push_acts_only_in_its_interval() {
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
fn impossible_pushes_are_rejected_by_key() {
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
        ("physics.rapier", "panda", "duration = \"1 s\", torque = [nan, 0.0, 0.0]", "torque"),
        ("physics.articulated", "quadruped", "duration = \"1 s\"", "neither a force nor a torque"),
    ] {
        let error = check(text(kind, robot, &push(rest))).map(|_| ()).unwrap_err().render(false);
        assert!(error.contains(expected) && error.contains("pushes"), "{rest}: {error}");
    }
}

/// Without contacts, friction and gravity a wrench on a link is the generalized force `J' f`: from rest
/// `M a = J' f`.
#[test]
fn a_link_wrench_accelerates_an_arm_by_its_jacobian() {
    let arm = load("panda", std::path::Path::new(".")).unwrap();
    let mut q = arm.profile.unwrap().home(&arm.model).unwrap().as_slice().to_vec();
    q[7] = 0.02;
    let free = motorium_robots::BodyFactors { damping: 0.0, friction: 0.0, ..Default::default() };
    let model = arm.model.with_factors(1.0, &vec![free; arm.model.bodies().len()]);
    let world = World { gravity: [0.0; 3], ..World::default() };
    let (link, point) = (model.frame("panda_hand").unwrap(), Point3::new(0.03, -0.02, 0.1));
    let (force, torque) = (Vector3::new(4.0, -3.0, 6.0), Vector3::new(-0.5, 0.8, 0.3));
    let mut kinematics = motorium_robots::Kinematics::new(&model);
    kinematics.update(&model, &q);
    let mut jacobian = nalgebra::Matrix6xX::zeros(model.nv());
    kinematics.jacobian(&model, link, motorium_robots::Reference::LocalWorldAligned, &mut jacobian);
    let arm = kinematics.pose(&model, link).rotation * point.coords;
    let moment = torque + arm.cross(&force);
    let wrench = nalgebra::Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
    let tau = jacobian.transpose() * wrench;
    let mut expected = vec![0.0; model.nv()];
    let rest = vec![0.0; model.nv()];
    Dynamics::new(&model)
        .forward(&model, &q, &rest, tau.as_slice(), Vector3::zeros(), &mut expected)
        .unwrap();
    let h = 1e-4;
    let mut ours = ArticulatedSimulator::new(model.clone(), world.clone(), &q, Engine::default()).unwrap();
    let mut rapier = RapierSimulator::new(model.clone(), world, &q, Engine::default()).unwrap();
    let engines: [(&str, &mut dyn Simulator); 2] = [("articulated", &mut ours), ("rapier", &mut rapier)];
    let largest = expected.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
    for (name, simulator) in engines {
        simulator.commands_mut().fill(JointSetpoint::default());
        // in the second step, too: nothing of the first remains
        let mut before = rest.clone();
        for step in 0..3 {
            if step != 1 {
                simulator.apply_wrench(link, point, force, torque);
            }
            simulator.step(h).unwrap();
            let after = simulator.velocity().to_vec();
            for (joint, ((after, before), expected)) in after.iter().zip(&before).zip(&expected).enumerate() {
                let expected = if step == 1 { 0.0 } else { *expected };
                let found = (after - before) / h;
                assert!(
                    (found - expected).abs() < 0.02 * largest,
                    "{name}, step {step}, joint {joint}: {found}, {expected}"
                );
            }
            before = after;
        }
    }
}
