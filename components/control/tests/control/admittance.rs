//! Admittance: the response of a mass on a spring and a damper, finite differences, and a Panda in a graph.

use approx::assert_abs_diff_eq;
use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Source, allocations};
use motorium_control::{
    Admittance, AdmittanceSettings, RobotState,
    tasks::{CartesianSettings, CartesianTask, VelocityTask},
};
use motorium_robots::{Kinematics, Twist, load};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::component::number;
use crate::graph::{Targets, bare_controller, controller, graph};
use crate::robot::Random;

/// Displacement after a step of the force by `f`: the solution of the differential equation from rest.
fn response(mass: f64, damping: f64, stiffness: f64, force: f64, t: f64) -> f64 {
    let (decay, square) = (0.5 * damping / mass, stiffness / mass);
    if stiffness == 0.0 {
        let rate = damping / mass;
        return force / damping * (t - (1.0 - (-rate * t).exp()) / rate);
    }
    let swing = square - decay * decay;
    let still = force / stiffness;
    if swing.abs() < 1e-9 {
        return still * (1.0 - (1.0 + decay * t) * (-decay * t).exp());
    }
    if swing > 0.0 {
        let w = swing.sqrt();
        return still * (1.0 - (-decay * t).exp() * ((w * t).cos() + decay / w * (w * t).sin()));
    }
    let w = (-swing).sqrt();
    let (slow, fast) = (decay - w, decay + w);
    still * (1.0 - (fast * (-slow * t).exp() - slow * (-fast * t).exp()) / (fast - slow))
}

#[test]
fn a_push_has_the_response_of_mass_spring_and_damper() {
    for (mass, damping, stiffness) in
        [(2.0, 4.0, 100.0), (4.0, 40.0, 100.0), (2.0, 100.0, 50.0), (3.0, 20.0, 0.0), (1.0, 2000.0, 10.0)]
    {
        for dt in [1e-3, 0.01, 0.1] {
            let settings = AdmittanceSettings {
                mass,
                damping,
                stiffness,
                max_displacement: f64::INFINITY,
                ..AdmittanceSettings::default()
            };
            let mut hand = Admittance::new(settings);
            let force = Vector3::new(3.0, -1.0, 0.5);
            for step in 1..=(2.0_f64 / dt).round() as u32 {
                let made = allocations(|| hand.step(&force, &Vector3::zeros(), dt));
                assert_eq!(made, 0);
                let expected = force.map(|f| response(mass, damping, stiffness, f, f64::from(step) * dt));
                assert_abs_diff_eq!(*hand.displacement(), expected, epsilon = 1e-9);
            }
        }
    }
}

#[test]
fn a_rotation_has_the_same_response_and_is_bounded() {
    let settings = AdmittanceSettings { max_rotation: 0.4, ..AdmittanceSettings::default() };
    let mut hand = Admittance::new(settings);
    let torque = Vector3::new(0.0, 2.0, 0.0);
    for step in 1..=1000 {
        hand.step(&Vector3::zeros(), &torque, 1e-3);
        let expected = response(0.1, 2.0, 10.0, 2.0, f64::from(step) * 1e-3);
        assert_abs_diff_eq!(hand.turn().y, expected, epsilon = 1e-9);
    }
    for _ in 0..1000 {
        hand.step(&Vector3::new(1e3, 0.0, 0.0), &(torque * 10.0), 1e-3);
        assert!(hand.turn().norm() <= 0.4 + 1e-12 && hand.displacement().norm() <= 0.2 + 1e-12);
    }
    assert_abs_diff_eq!(hand.displacement().x, 0.2, epsilon = 1e-12);
    assert_abs_diff_eq!(hand.velocity().x, 0.0, epsilon = 1e-12);
    // a wrench that is not finite is ignored
    hand.step(&Vector3::new(f64::NAN, 0.0, 0.0), &torque, 1e-3);
    assert!(hand.displacement().iter().all(|x| x.is_finite()));
}

#[test]
fn the_displaced_velocity_is_the_derivative_of_the_pose() {
    let mut random = Random(61);
    let mut any = |size: f64| Vector3::new(random.within(size), random.within(size), random.within(size));
    let settings = AdmittanceSettings { max_rotation: 3.0, ..AdmittanceSettings::default() };
    for _ in 0..20 {
        let target = Isometry3::from_parts(any(1.0).into(), UnitQuaternion::from_scaled_axis(any(1.0)));
        let moving = Twist { linear: any(0.5), angular: any(0.5) };
        let (force, torque) = (any(20.0), any(3.0));
        let mut hand = Admittance::new(settings);
        for _ in 0..300 {
            hand.step(&force, &torque, 1e-3);
        }
        let h = 1e-5;
        // the pose shortly afterwards: of the target, and of the mass under another push
        let torque = torque * 0.3 + any(1.0);
        let at = |steps: f64| {
            let mut hand = hand.clone();
            let goal = Isometry3::from_parts(
                (target.translation.vector + moving.linear * steps * h).into(),
                UnitQuaternion::from_scaled_axis(moving.angular * steps * h) * target.rotation,
            );
            if steps > 0.0 {
                hand.step(&force, &torque, steps * h);
            }
            (hand.displace(&goal, &moving), hand)
        };
        let ((behind, ..), _) = at(0.0);
        let ((_, velocity, _), _) = at(1.0);
        let ((ahead, _, acceleration), _) = at(2.0);
        let linear = (ahead.translation.vector - behind.translation.vector) / (2.0 * h);
        let angular = (ahead.rotation * behind.rotation.inverse()).scaled_axis() / (2.0 * h);
        assert_abs_diff_eq!(velocity.linear, linear, epsilon = 1e-6);
        assert_abs_diff_eq!(velocity.angular, angular, epsilon = 1e-5);
        let (_, before, _) = at(0.0).0;
        let (_, after, _) = at(2.0).0;
        let expected = (after.linear - before.linear) / (2.0 * h);
        assert_abs_diff_eq!(acceleration.linear, expected, epsilon = 1e-6);
    }
}

#[test]
fn the_displaced_task_has_the_derivative_of_its_error() {
    let mut random = Random(67);
    for name in ["panda", "humanoid"] {
        let robot = load(name, std::path::Path::new(".")).unwrap();
        let (model, profile) = (&robot.model, robot.profile.as_ref().unwrap());
        let frame = model.frame(&model.frames().last().unwrap().name).unwrap();
        let mut q = model.neutral();
        let joints = model.nq() - model.joint_count();
        q[joints..].copy_from_slice(profile.home(model).unwrap().as_slice());
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, &q);
        let mut hand = Admittance::new(AdmittanceSettings::default());
        for _ in 0..200 {
            hand.step(&Vector3::new(10.0, -5.0, 3.0), &Vector3::new(0.5, 1.0, -0.5), 1e-3);
        }
        let (pose, velocity, _) = hand.displace(&kinematics.pose(model, frame), &Twist::zero());
        let settings = CartesianSettings { gain: 0.0, ..CartesianSettings::default() };
        let mut task = CartesianTask::new(model, frame).with(settings);
        let mut error = |q: &[f64], target: Isometry3<f64>| {
            let mut kinematics = Kinematics::new(model);
            kinematics.update(model, q);
            task.set_moving_target(target, velocity, Twist::zero());
            task.update(&RobotState { model, kinematics: &kinematics, q });
            (task.error(), task.clone())
        };
        let v: Vec<f64> = (0..model.nv()).map(|_| random.within(1.0)).collect();
        let (_, posed) = error(&q, pose);
        let h = 1e-6;
        let mut moved = |time: f64| {
            let step: Vec<f64> = v.iter().map(|v| v * time).collect();
            let mut there = q.clone();
            model.integrate(&q, &step, &mut there);
            let target = Isometry3::from_parts(
                (pose.translation.vector + velocity.linear * time).into(),
                UnitQuaternion::from_scaled_axis(velocity.angular * time) * pose.rotation,
            );
            error(&there, target).0
        };
        let rate = (moved(h) - moved(-h)) / (2.0 * h);
        // e' = b - A v without a gain, and the residual is its length
        assert!((posed.residual(&v) - rate.norm()).abs() < 1e-6, "{name}: {} {rate}", posed.residual(&v));
    }
}

const TASKS: &str = "tasks = [{ admittance = { stiffness = 200.0, damping = 60.0 } }, { posture = { level = 2, weight = 1.0 } }]";

/// A run in which the hand of the Panda is pushed with 10 N along its x axis from 0.5 s until `until`.
fn pushed(config: &str, until: f64, seconds: &str) -> Report {
    let push = Source::new("push", "panda/wrench", move |tick| {
        let force = if (0.5..until).contains(&tick.time()) { 10.0 } else { 0.0 };
        Some(Wrench { force: [force, 0.0, 0.0], torque: [0.0; 3] })
    });
    let controller = bare_controller(config).robot("panda").subscribe("wrench", "panda/wrench");
    graph("{}", Targets { offsets: vec![[0.0; 3]], ..Targets::default() }, controller)
        .with(push)
        .run(seconds)
        .unwrap()
}

#[test]
fn a_pushed_hand_yields_by_force_over_stiffness_and_returns() {
    for config in [format!("{{ {TASKS} }}"), format!("{{ inverse_dynamics = {{}}, {TASKS} }}")] {
        let held = pushed(&config, 9.0, "4 s");
        let task = &held.results["controller"]["tasks"]["admittance"];
        let displacement: Vec<f64> =
            task["last_displacement_m"].as_array().unwrap().iter().map(number).collect();
        let length = displacement.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((length - 0.05).abs() < 1e-4, "{config}: {task}");
        assert!(number(&task["last_position_error_m"]) < 1e-3, "{config}: {task}");
        assert_eq!(held.results["controller"]["steps_without_solution"], 0);
        let component = held.components.iter().find(|component| component.name == "controller").unwrap();
        assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));

        let released = pushed(&config, 1.5, "4 s");
        let task = &released.results["controller"]["tasks"]["admittance"];
        assert!(number(&task["largest_displacement_m"]) > 0.04, "{task}");
        assert!(number(&task["last_displacement_m"][0]).abs() < 1e-3, "{task}");
    }
}

#[test]
fn invalid_admittances_are_refused_by_key() {
    let refused = |config: &str, words: &[&str]| {
        let graph = graph("{}", Targets::default(), controller(config).subscribe("wrench", "panda/target"));
        let error = graph.check().expect_err("it must be refused").render(false);
        for words in words {
            assert!(error.contains(words), "no `{words}` in\n{error}");
        }
    };
    refused("{ tasks = [{ admittance = { mass = 0.0 } }] }", &["tasks[0].admittance.mass", "from 0.001"]);
    refused(
        "{ tasks = [{ admittance = { sensor = \"panda_hnad\" } }] }",
        &["admittance.sensor", "panda_hand"],
    );
    refused(
        "{ tasks = [{ admittance = {} }, { admittance = { name = \"other\", target = \"other_target\" } }] }",
        &["two tasks read their wrench from `wrench`", "left_wrench"],
    );
}
