//! Tasks that move points: gaze and capture point, compared with finite differences and the requested decay.

use motorium_control::inverse_dynamics::{AccelerationTask, InverseDynamics};
use motorium_control::tasks::{CapturePoint, Feedback, ForceRegularisation};
use motorium_control::tasks::{
    CartesianSettings, CartesianTask, CentreOfMassSettings, CentreOfMassTask, GazeTask, MomentumTask,
    PostureTask,
};
use motorium_robots::{FrameId, Momentum};
use nalgebra::{DVector, Unit, Vector2, Vector3};

use crate::robots::{Random, Robot};
use crate::tasks::rows;

const H: f64 = 1e-5;
const NONE: Feedback = Feedback { kp: 0.0, kd: 0.0 };

/// The direction to a point in the axes of a frame.
fn direction(robot: &Robot, frame: FrameId, point: Vector3<f64>) -> Vector3<f64> {
    let pose = robot.kinematics.pose(&robot.model, frame);
    (pose.rotation.inverse() * (point - pose.translation.vector)).normalize()
}

#[test]
fn gaze_without_gains_requests_no_acceleration() {
    let mut random = Random(51);
    for name in ["panda", "humanoid", "quadruped"] {
        for _ in 0..5 {
            let robot = Robot::new(name).moved(&mut random);
            let model = &robot.model;
            let frame = model.frame(&model.frames().last().unwrap().name).unwrap();
            let (point, velocity) = (random.vector(1.5), random.vector(1.0));
            let mut control = InverseDynamics::new(model, Vec::new());
            control.begin(&robot.state(), 1e-3);
            let mut task =
                GazeTask::new(model, frame, Unit::new_normalize(random.vector(1.0))).feedback(NONE);
            task.set_moving_target(point, velocity);
            task.update(&robot.state(), &control);
            let a = robot.accelerations(&mut random);
            // the rate s of the axis relative to the point: -u x u'
            let rate = |time: f64| {
                let at = |time: f64| direction(&robot.after(&a, time), frame, point + velocity * time);
                -at(time).cross(&((at(time + H) - at(time - H)) / (2.0 * H)))
            };
            let h = 2e-4;
            let expected = (rate(h) - rate(-h)) / (2.0 * h);
            let found = rows(task.cost(), &a);
            let close = 2e-4 * (1.0 + expected.norm());
            assert!((&found - expected).amax() < close, "{name}: {found} {expected}");
        }
    }
}

#[test]
fn the_angle_of_a_gaze_decays_critically_damped() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    let frame = model.frame("panda_hand_tcp").unwrap();
    let (rate, dt) = (6.0, 1e-3);
    let mut gaze = GazeTask::new(&model, frame, Vector3::z_axis()).feedback(Feedback::critical(rate));
    let hand = robot.kinematics.pose(&model, frame);
    // the frame only turns about its origin, so that the angle has one dimension
    gaze.set_target(hand.translation.vector + hand.rotation * Vector3::new(0.3, 0.0, 1.0));
    let start = 0.3_f64.atan();
    let mut stay = CartesianTask::new(&model, frame)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(20.0))
        .with(CartesianSettings { orientation_weight: 0.0, ..Default::default() });
    stay.set_target(hand);
    let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(2.0)).weight(1e-3);
    let mut control = InverseDynamics::new(&model, Vec::new());
    for step in 0..1500 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut gaze);
        control.add_task(&robot.state(), 0, &mut stay);
        control.add_task(&robot.state(), 0, &mut posture);
        let t = f64::from(step) * dt;
        let expected = start * (1.0 + rate * t) * (-rate * t).exp();
        assert!(
            (gaze.error().norm() - expected).abs() < 2e-3,
            "at {t} s: {} {expected}",
            gaze.error().norm()
        );
        let a = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&a, dt);
    }
}

/// A controller of a humanoid on its soles.
fn standing(robot: &Robot) -> InverseDynamics {
    let mut control = InverseDynamics::new(&robot.model, robot.feet());
    control.begin(&robot.state(), 1e-3);
    control
}

#[test]
fn capture_point_moves_as_predicted_by_its_task() {
    let mut random = Random(53);
    for name in ["humanoid", "quadruped"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let control = standing(&robot);
        let gain = 4.0;
        let (target, velocity) = (random.vector(0.2).xy(), random.vector(0.2).xy());
        let mut task = CapturePoint::new(model, gain);
        task.set_moving_target(target, velocity);
        task.update(&robot.state(), &control);
        let a = robot.accelerations(&mut random);
        let (centre, rate) = (robot.kinematics.centre_of_mass(model), task.rate());
        let feet: f64 =
            robot.feet().iter().map(|foot| robot.kinematics.pose(model, foot.frame).translation.z).sum();
        let ball = if name == "quadruped" { 0.0165 } else { 0.0 };
        let ground = feet / robot.feet().len() as f64 - ball;
        assert!((rate - (9.81 / (centre.position.z - ground)).sqrt()).abs() < 1e-9, "{name}: {rate}");
        let point = |robot: &Robot| {
            let moving = robot.kinematics.centre_of_mass(model);
            moving.position.xy() + moving.velocity.xy() / rate
        };
        assert!((task.point() - point(&robot)).norm() < 1e-12);
        let moved = (point(&robot.after(&a, H)) - point(&robot.after(&a, -H))) / (2.0 * H);
        let expected: Vector2<f64> = (moved - velocity - (target - point(&robot)) * gain) * rate;
        let found = rows(task.cost(), &a);
        assert!((&found - expected).amax() < 1e-4, "{name}: {found} {expected}");
    }
    // a fixed base has no contacts, so the task requests nothing
    let robot = Robot::new("panda");
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    control.begin(&robot.state(), 1e-3);
    let mut task = CapturePoint::new(&robot.model, 3.0);
    task.update(&robot.state(), &control);
    assert_eq!(task.cost().residual(&vec![1.0; robot.model.nv()]), 0.0);
    assert_eq!(task.rate(), 0.0);
}

#[test]
fn a_humanoid_comes_to_rest_by_its_capture_point() {
    let mut robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let (gain, dt) = (3.0, 2e-3);
    let start = robot.kinematics.centre_of_mass(&model).position;
    let target = start.xy() + Vector2::new(0.02, 0.01);
    let mut balance = CapturePoint::new(&model, gain).weight(10.0);
    balance.set_target(target);
    let mut height = CentreOfMassTask::new(&model).with(CentreOfMassSettings {
        gain: 8.0,
        shares: [0.0, 0.0, 1.0],
        ..CentreOfMassSettings::default()
    });
    height.set_target(start);
    let mut height = height.weight(10.0);
    let mut upright = MomentumTask::angular(&model).rate(5.0).weights(0.0, 10.0);
    upright.set_moving_target(
        Momentum { linear: Vector3::zeros(), angular: Vector3::zeros() },
        Momentum { linear: Vector3::zeros(), angular: Vector3::zeros() },
    );
    let mut posture = PostureTask::new(&model, &robot.q[7..]).feedback(Feedback::critical(3.0)).weight(0.01);
    let mut control = InverseDynamics::new(&model, robot.feet());
    let mut even = ForceRegularisation::new(&control).weight(1e-5);
    let mut first = None;
    for step in 0..1500 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut balance);
        control.add_task(&robot.state(), 0, &mut height);
        control.add_task(&robot.state(), 0, &mut upright);
        control.add_task(&robot.state(), 0, &mut posture);
        control.add_task(&robot.state(), 0, &mut even);
        let error: Vector2<f64> = balance.error();
        let t = f64::from(step) * dt;
        let expected = *first.get_or_insert(error) * (-gain * t).exp();
        assert!((error - expected).norm() < 1e-3, "at {t} s: {error} {expected}");
        let solution = control.solve().unwrap();
        assert!(solution.slack.is_none());
        let a: DVector<f64> = solution.acceleration.clone();
        // of a point mass at a constant height: the ground pushes at k + gain / o (k - k*)
        if step == 0 {
            let centre = robot.kinematics.centre_of_mass(&model);
            let pressure = *balance.point() - error * (gain / balance.rate());
            let acceleration = (centre.position.xy() - pressure) * balance.rate().powi(2);
            let jacobian = {
                let mut jacobian = nalgebra::Matrix3xX::zeros(model.nv());
                robot.kinematics.com_jacobian(&model, &mut jacobian);
                jacobian
            };
            let found = (jacobian * &a).xy() + centre.acceleration.xy();
            assert!((found - acceleration).norm() < 1e-2 * acceleration.norm(), "{found} {acceleration}");
        }
        robot = robot.after(&a, dt);
    }
    let end = robot.kinematics.centre_of_mass(&model);
    assert!((end.position.xy() - target).norm() < 1e-3, "{} {target}", end.position);
    assert!(end.velocity.xy().norm() < 5e-3, "{}", end.velocity);
}
