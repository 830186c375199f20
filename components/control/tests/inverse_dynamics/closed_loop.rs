//! Closed loops with ideal integration.

use motorium_control::inverse_dynamics::InverseDynamics;
use motorium_control::tasks::{CartesianSettings, CartesianTask, CentreOfMassTask, PostureTask};
use motorium_control::tasks::{Feedback, ForceRegularisation};

use crate::robots::Robot;

#[test]
fn an_arm_reaches_its_target_critically_damped_and_exactly() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    let hand = model.frame("panda_hand_tcp").unwrap();
    let start = robot.kinematics.pose(&model, hand);
    let mut target = start;
    target.translation.y += 0.1;
    let rate = 6.0;
    let mut reach = CartesianTask::new(&model, hand)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(rate));
    reach.set_target(target);
    let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(2.0)).weight(1e-3);
    let mut control = InverseDynamics::new(&model, Vec::new());
    let dt = 1e-3;
    for step in 0..3000 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut reach);
        control.add_task(&robot.state(), 0, &mut posture);
        let a = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&a, dt);
        // e(t) = e0 (1 + rate t) exp(-rate t)
        let t = (f64::from(step) + 1.0) * dt;
        let expected = 0.1 * (1.0 + rate * t) * (-rate * t).exp();
        let error = target.translation.y - robot.kinematics.pose(&model, hand).translation.y;
        assert!((error - expected).abs() < 1e-3, "at {t} s: {error} m, expected {expected} m");
    }
    let end = robot.kinematics.pose(&model, hand);
    assert!((end.translation.vector - target.translation.vector).norm() < 1e-4);
    assert!(end.rotation.angle_to(&target.rotation) < 1e-3);
}

#[test]
fn humanoid_shifts_its_weight_without_moving_its_feet() {
    let mut robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let feet = robot.feet();
    let soles: Vec<_> = feet.iter().map(|foot| robot.kinematics.pose(&model, foot.frame)).collect();
    let mut control = InverseDynamics::new(&model, feet.clone());
    let start = robot.kinematics.centre_of_mass(&model).position;
    let mut centre = CentreOfMassTask::new(&model).feedback(Feedback::critical(4.0)).weight(10.0);
    let target = start + nalgebra::Vector3::new(0.01, 0.04, -0.02);
    centre.set_target(target);
    let mut posture = PostureTask::new(&model, &robot.q[7..]).feedback(Feedback::critical(4.0)).weight(0.1);
    let mut even = ForceRegularisation::new(&control).weight(1e-4);
    for _ in 0..1500 {
        control.begin(&robot.state(), 2e-3);
        control.add_task(&robot.state(), 0, &mut centre);
        control.add_task(&robot.state(), 0, &mut posture);
        control.add_task(&robot.state(), 0, &mut even);
        let solution = control.solve().unwrap();
        assert!(solution.slack.is_none());
        let a = solution.acceleration.clone();
        robot = robot.after(&a, 2e-3);
    }
    let end = robot.kinematics.centre_of_mass(&model).position;
    assert!((end - target).norm() < 3e-3, "{end} {target}");
    for (foot, sole) in feet.iter().zip(soles) {
        let now = robot.kinematics.pose(&model, foot.frame);
        assert!((now.translation.vector - sole.translation.vector).norm() < 1e-3, "{now}");
        assert!(now.rotation.angle_to(&sole.rotation) < 1e-3, "{now}");
    }
}

#[test]
fn a_held_robot_gets_static_torques() {
    let robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let mut control = InverseDynamics::new(&model, robot.feet());
    let mut centre = CentreOfMassTask::new(&model).feedback(Feedback::critical(4.0)).weight(10.0);
    let start = robot.kinematics.centre_of_mass(&model).position;
    let mut posture = PostureTask::new(&model, &robot.q[7..]).feedback(Feedback::critical(4.0)).weight(0.1);
    let mut decide = |offset: nalgebra::Vector3<f64>| {
        centre.set_target(start + offset);
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut centre);
        control.add_task(&robot.state(), 0, &mut posture);
        let moving = control.solve().unwrap().torque.clone();
        let mut held = vec![0.0; model.joint_count()];
        control.write_holding_torque(&robot.state(), &mut held);
        (moving, nalgebra::DVector::from_vec(held))
    };
    let (standing, held) = decide(nalgebra::Vector3::zeros());
    let far = (&standing - &held).amax();
    assert!(standing.amax() > 1.0 && far < 0.1, "{far} Nm of {} Nm", standing.amax());
    // the lateral contact forces remain, but the robot's own acceleration vanishes
    let (moving, held) = decide(nalgebra::Vector3::new(0.0, 0.03, 0.0));
    assert!((&moving - &standing).amax() > 1.0 && (&moving - &held).amax() > 0.1, "{moving} {held}");
}
