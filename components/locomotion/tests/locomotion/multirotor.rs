//! `control.multirotor` in a graph, with a rigid body driven by the rotors of the catalogue's quadrotor.

use std::path::Path;

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_locomotion::MultirotorController;
use motorium_robots::Spin;
use nalgebra::{UnitQuaternion, Vector3};

/// Creates the catalogue's quadrotor with mass `mass`; `None` keeps the mass of the model.
fn plant(mass: Option<f64>, height: f64) -> Function {
    let robot = motorium_robots::load("quadrotor", Path::new(".")).unwrap();
    let inertia = robot.model.base().inertia;
    let rotors: Vec<(Vector3<f64>, f64)> = robot
        .profile
        .unwrap()
        .rotors
        .values()
        .map(|rotor| {
            let frame = robot.model.frame(&rotor.frame).unwrap();
            let place = robot.model.frames()[frame.index()].placement.translation.vector;
            let sign = if rotor.spin == Spin::Clockwise { 1.0 } else { -1.0 };
            (place, sign * rotor.torque_per_thrust)
        })
        .collect();
    let mass = mass.unwrap_or(inertia.mass);
    let (mut place, mut turn) = (Vector3::new(0.0, 0.0, height), UnitQuaternion::identity());
    let (mut velocity, mut spin) = (Vector3::zeros(), Vector3::zeros());
    Function::new::<JointCommand, BaseState>("plant", "command", "base", move |tick, command| {
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for (rotor, thrust) in rotors.iter().zip(command.map_or(&[][..], |command| command.effort())) {
            let pull = Vector3::new(0.0, 0.0, thrust.clamp(0.0, 0.15));
            force += pull;
            torque += rotor.0.cross(&pull) + Vector3::new(0.0, 0.0, rotor.1 * pull.z);
        }
        let dt = tick.dt();
        velocity += dt * (turn * force / mass - Vector3::new(0.0, 0.0, 9.81));
        let moment = torque - spin.cross(&(inertia.rotational * spin));
        spin += dt * inertia.rotational.try_inverse().unwrap() * moment;
        place += dt * velocity;
        turn *= UnitQuaternion::from_scaled_axis(dt * spin);
        Some(BaseState {
            position: place.into(),
            orientation: turn.coords.into(),
            linear_velocity: (turn.inverse() * velocity).into(),
            angular_velocity: spin.into(),
        })
    })
}

fn controller(config: &str) -> Instance {
    let config: toml::Table = format!("config = {config}").parse().unwrap();
    Instance::of::<MultirotorController>("controller")
        .robot("quadrotor")
        .trigger("base")
        .subscribe("base_state", "base")
        .publish("joint_command", "command")
        .set("config", config["config"].clone())
}

fn graph(robot: &str, plant: Function, controller: Instance) -> Graph {
    Graph::new("flight-test").robot("quadrotor", robot).with(plant).with(controller)
}

/// Creates a target that moves half a metre up and sideways in 2 s with minimum jerk and then rests.
fn climb() -> Source {
    Source::new("targets", "target", |tick| {
        let s = (0.5 * tick.time()).min(1.0);
        let (share, rate) = (s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s), 15.0 * (s * (1.0 - s)).powi(2));
        Some(PoseTarget {
            position: [0.3 * share, -0.2 * share, 1.0 + 0.5 * share],
            orientation: UnitQuaternion::from_euler_angles(0.0, 0.0, 1.2).coords.into(),
            linear_velocity: [0.3 * rate, -0.2 * rate, 0.5 * rate],
            goal: 1,
            at_goal: u64::from(s >= 1.0),
            ..PoseTarget::default()
        })
    })
}

fn number(report: &Report, key: &str) -> f64 {
    report.results["controller"][key].as_f64().unwrap_or_else(|| panic!("{}", report.results["controller"]))
}

#[test]
fn flies_to_its_goal_without_allocating() {
    let led = controller("{}").subscribe("target", "target");
    let report = graph("quadrotor", plant(None, 1.0), led).with(climb()).run("5 s").unwrap();
    assert_eq!(report.results["controller"]["goals_reached"], 1, "{}", report.results["controller"]);
    assert!(number(&report, "position_error_m") < 2e-3 && number(&report, "yaw_error_rad") < 1e-3);
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
}

#[test]
fn multirotor_without_a_target_holds_its_position() {
    let base = Probe::<BaseState>::for_topic("base");
    let report =
        graph("quadrotor", plant(Some(0.031), 1.0), controller("{}")).with(&base).run("12 s").unwrap();
    let last = base.values().last().unwrap().position;
    assert!((last[2] - 1.0).abs() < 2e-3 && last[0].hypot(last[1]) < 1e-6, "{last:?}");
    assert_eq!(report.results["controller"]["goals_reached"], 0, "there was no goal");
}

#[test]
fn goal_outside_the_tolerance_is_not_reached() {
    // a quarter heavier than its model, and no integral term
    let led = controller("{ integral_rate = 0.0 }").subscribe("target", "target");
    let report = graph("quadrotor", plant(Some(0.035), 1.0), led).with(climb()).run("5 s").unwrap();
    assert_eq!(report.results["controller"]["goals_missed"], 1, "{}", report.results["controller"]);
    assert!(number(&report, "position_error_m") > 0.05);
}

#[test]
fn unflyable_robots_are_rejected_with_a_reason() {
    for (robot, config, words) in [
        ("panda", "{}", "has no rotors"),
        ("quadrotor", "{ attitude_frequency = 5.0 }", "at least three times `position_frequency`"),
        ("quadrotor", "{ max_thrust_share = 0.4 }", "produce at most 0.240 N"),
        ("quadrotor", "{ integral_rate = 9.0 }", "expected a number from 0 to 4"),
    ] {
        let error = graph(robot, plant(None, 1.0), controller(config)).check().expect_err("it is rejected");
        assert!(error.render(false).contains(words), "{}", error.render(false));
    }
}
