//! Velocity tasks in acceleration form, compared with finite differences of motions and the requested decay.

use motorium_control::tasks::Feedback;
use motorium_control::tasks::{PostureTask, RelativeSettings, RelativeTask, RigidRotationTask, UnicycleTask};
use motorium_control::{
    RobotState,
    inverse_dynamics::{AccelerationTask, InverseDynamics},
    tasks::{
        ManipulabilityTask, MinimumEffortTask, MinimumVelocityTask, RollingTask, UnicycleSettings,
        VelocityTask,
    },
};
use motorium_robots::{Dynamics, FrameId, TaskRows};
use nalgebra::{DVector, Isometry3, Unit, Vector3, Vector6};

use crate::robots::{Random, Robot};
use crate::tasks::rows;

const H: f64 = 1e-5;
const NONE: Feedback = Feedback { kp: 0.0, kd: 0.0 };
const ROBOTS: [&str; 3] = ["panda", "humanoid", "quadruped"];

/// Two frames that move relative to each other.
fn frames(robot: &Robot) -> (FrameId, FrameId) {
    let frames = robot.model.frames();
    let [one, other] = [frames.len() / 2, frames.len() - 1].map(|index| &frames[index].name);
    (robot.model.frame(one).unwrap(), robot.model.frame(other).unwrap())
}

fn begun(robot: &Robot) -> InverseDynamics {
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    control.begin(&robot.state(), 1e-3);
    control
}

#[test]
fn relative_task_without_gains_requests_no_acceleration() {
    let mut random = Random(61);
    for name in ROBOTS {
        for _ in 0..5 {
            let robot = Robot::new(name).moved(&mut random);
            let (a, b) = frames(&robot);
            let mut task =
                RelativeTask::new(&robot.model, a, b).with(RelativeSettings::geometric()).feedback(NONE);
            AccelerationTask::update(&mut task, &robot.state(), &begun(&robot));
            let acceleration = robot.accelerations(&mut random);
            let pose = |time: f64| -> Isometry3<f64> {
                let next = robot.after(&acceleration, time);
                let [a, b] = [a, b].map(|frame| next.kinematics.pose(&next.model, frame));
                a.inv_mul(&b)
            };
            let velocity = |time: f64| {
                let (ahead, behind) = (pose(time + H), pose(time - H));
                let linear = (ahead.translation.vector - behind.translation.vector) / (2.0 * H);
                let angular = (ahead.rotation * behind.rotation.inverse()).scaled_axis() / (2.0 * H);
                Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
            };
            let h = 2e-4;
            let expected = (velocity(h) - velocity(-h)) / (2.0 * h);
            let found = rows(task.cost(), &acceleration);
            let close = 2e-4 * (1.0 + expected.norm());
            assert!((&found - expected).amax() < close, "{name}: {found} {expected}");
        }
    }
}

#[test]
fn logarithmic_relative_errors_accelerate_as_predicted() {
    let mut random = Random(67);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let (model, (a, b)) = (&robot.model, frames(&robot));
        let mut task = RelativeTask::new(model, a, b).feedback(NONE);
        let now = robot.kinematics.pose(model, a).inv_mul(&robot.kinematics.pose(model, b));
        task.set_target(now * Isometry3::new(random.vector(0.3), random.vector(0.8)));
        AccelerationTask::update(&mut task, &robot.state(), &begun(&robot));
        let acceleration = robot.accelerations(&mut random);
        let error = |time: f64| {
            let (next, mut later) = (robot.after(&acceleration, time), task.clone());
            VelocityTask::update(&mut later, &next.state().robot());
            later.error()
        };
        let h = 1e-3;
        let expected = (error(h) - error(0.0) * 2.0 + error(-h)) / (h * h);
        let found = rows(task.cost(), &acceleration);
        let close = 1e-4 * (1.0 + expected.norm());
        assert!((&found + expected).amax() < close, "{name}: {found} {expected}");
    }
}

#[test]
fn the_error_of_a_relative_task_decays_critically_damped() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    let (a, b) = (model.frame("panda_link1").unwrap(), model.frame("panda_hand_tcp").unwrap());
    let (rate, dt) = (5.0, 1e-3);
    let mut task = RelativeTask::new(&model, a, b)
        .with(RelativeSettings::geometric())
        .feedback(Feedback::critical(rate));
    let [at_a, at_b] = [a, b].map(|frame| robot.kinematics.pose(&model, frame));
    let away = Vector3::new(-0.05, 0.04, 0.06);
    task.set_target(Isometry3::from(away) * at_a.inv_mul(&at_b));
    let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(2.0)).weight(1e-3);
    let mut control = InverseDynamics::new(&model, Vec::new());
    for step in 0..1200 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut task);
        control.add_task(&robot.state(), 0, &mut posture);
        let t = f64::from(step) * dt;
        let expected = away * (1.0 + rate * t) * (-rate * t).exp();
        let found = Vector3::from(task.error().fixed_rows::<3>(0));
        assert!((found - expected).norm() < 2e-3, "at {t} s: {found} {expected}");
        let a = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&a, dt);
    }
}

#[test]
fn unicycle_corrects_velocity_in_the_turning_frame() {
    let mut random = Random(62);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let (model, (_, frame), rate) = (&robot.model, frames(&robot), 7.0);
        let settings = UnicycleSettings { forward: 0.4, yaw_rate: -0.3, ..UnicycleSettings::default() };
        let mut task = UnicycleTask::new(model, frame).rate(rate).with(settings);
        AccelerationTask::update(&mut task, &robot.state(), &begun(&robot));
        let a = robot.accelerations(&mut random);
        let speeds = |time: f64| {
            let next = robot.after(&a, time);
            let axes = next.kinematics.pose(model, frame).rotation.inverse();
            let moving = next.kinematics.velocity(model, frame);
            let (v, w) = (axes * moving.linear, axes * moving.angular);
            Vector3::new(v.x, v.y, w.z)
        };
        let error = speeds(0.0) - Vector3::new(0.4, 0.0, -0.3);
        let expected = (speeds(H) - speeds(-H)) / (2.0 * H) + error * rate;
        let found = rows(task.cost(), &a);
        assert!((&found - expected).amax() < 1e-5, "{name}: {found} {expected}");
    }
}

#[test]
fn contact_point_of_a_rolling_wheel_comes_to_rest() {
    let mut random = Random(63);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let (model, (_, frame), rate) = (&robot.model, frames(&robot), 9.0);
        let (axis, normal) =
            (Unit::new_normalize(random.vector(1.0)), Unit::new_normalize(random.vector(1.0)));
        let mut task = RollingTask::new(model, frame, axis, 0.3).rate(rate).on(normal);
        AccelerationTask::update(&mut task, &robot.state(), &begun(&robot));
        let a = robot.accelerations(&mut random);
        let slip = |time: f64| {
            let next = robot.after(&a, time);
            // the lowest point of the rim by definition: the point in the wheel's plane farthest against the
            // normal
            let d = next.kinematics.pose(model, frame).rotation * axis.into_inner();
            let side = d.cross(&normal).normalize();
            let c = -side.cross(&d) * 0.3;
            assert!(c.dot(&normal) < 0.0 && c.dot(&d).abs() < 1e-12);
            let moving = next.kinematics.velocity(model, frame);
            moving.linear + moving.angular.cross(&c)
        };
        let expected = (slip(H) - slip(-H)) / (2.0 * H) + slip(0.0) * rate;
        let found = rows(task.cost(), &a);
        assert!((&found - expected).amax() < 1e-5, "{name}: {found} {expected}");
        // the rows equal the velocity task's
        let mut velocity = RollingTask::new(model, frame, axis, 0.3).on(normal);
        let state = RobotState { model, kinematics: &robot.kinematics, q: &robot.q };
        VelocityTask::update(&mut velocity, &state);
        assert!((velocity.residual(&robot.v) - slip(0.0).norm()).abs() < 1e-12);
    }
    // a flat wheel requests nothing
    let robot = Robot::new("panda");
    let (_, frame) = frames(&robot);
    let axis = robot.kinematics.pose(&robot.model, frame).rotation.inverse() * Vector3::z();
    let mut flat = RollingTask::new(&robot.model, frame, Unit::new_normalize(axis), 0.3).rate(9.0);
    AccelerationTask::update(&mut flat, &robot.state(), &begun(&robot));
    assert_eq!(flat.cost().weights().amax(), 0.0);
}

#[test]
fn a_steered_wheel_turns_to_its_course_critically_damped() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    let (wheel, base) = (model.frame("panda_link7").unwrap(), model.frame("panda_link0").unwrap());
    let pose = robot.kinematics.pose(&model, wheel);
    let (rate, dt, away) = (6.0, 1e-3, 0.5_f64);
    let mut task =
        RigidRotationTask::new(&model, wheel, base, Vector3::y_axis()).feedback(Feedback::critical(rate));
    // the level direction in which the wheel rolls, and a base that drives to the left of it
    let forward = (pose.rotation * Vector3::y()).cross(&Vector3::z()).normalize();
    let way = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::z() * away) * forward;
    task.set_twist(way.x, way.y, 0.0);
    let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(2.0)).weight(1e-4);
    let mut control = InverseDynamics::new(&model, Vec::new());
    for step in 0..1200 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut task);
        control.add_task(&robot.state(), 0, &mut posture);
        let t = f64::from(step) * dt;
        let expected = away * (1.0 + rate * t) * (-rate * t).exp();
        assert!((task.error() - expected).abs() < 5e-3, "at {t} s: {} {expected}", task.error());
        let a = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&a, dt);
    }
    // compared with differences of the angular velocity about the normal, on a turning base
    let mut random = Random(64);
    let robot = Robot::new("panda").moved(&mut random);
    task.set_twist(0.3, 0.1, 0.7);
    task = task.feedback(Feedback { kp: 0.0, kd: 4.0 });
    AccelerationTask::update(&mut task, &robot.state(), &begun(&robot));
    let a = robot.accelerations(&mut random);
    let turning = |time: f64| robot.after(&a, time).kinematics.velocity(&model, wheel).angular.z;
    let expected = (turning(H) - turning(-H)) / (2.0 * H) - 4.0 * (0.7 - turning(0.0));
    assert!((rows(task.cost(), &a)[0] - expected).abs() < 1e-5);
}

#[test]
fn velocities_decay_at_their_rate() {
    // at the home pose, far from the joint limits
    let (mut random, mut robot) = (Random(65), Robot::new("panda"));
    robot.v[..7].iter_mut().for_each(|v| *v = random.within(0.1));
    robot.update();
    let model = robot.model.clone();
    let (rate, dt) = (4.0, 1e-3);
    let start = DVector::from_column_slice(&robot.v);
    let mut task = MinimumVelocityTask::new(&model).weight(1.0).rate(rate);
    let mut control = InverseDynamics::new(&model, Vec::new());
    for step in 0..500 {
        let expected = &start * (1.0 - rate * dt).powi(step);
        assert!((DVector::from_column_slice(&robot.v) - expected).amax() < 1e-5, "step {step}");
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, &mut task);
        let a = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&a, dt);
    }
}

#[test]
fn torques_increase_manipulability_and_reduce_effort() {
    let (dt, rate) = (1e-3, 20.0);
    let tcp = |robot: &Robot| robot.model.frame("panda_hand_tcp").unwrap();
    let run = |task: &mut dyn AccelerationTask| {
        let mut robot = Robot::new("panda");
        let mut control = InverseDynamics::new(&robot.model, Vec::new());
        for _ in 0..1000 {
            control.begin(&robot.state(), dt);
            control.add_task(&robot.state(), 0, task);
            let a = control.solve().unwrap().acceleration.clone();
            robot = robot.after(&a, dt);
        }
        robot
    };
    let start = Robot::new("panda");
    let model = &start.model;
    let measure =
        |robot: &Robot| robot.kinematics.manipulability(&robot.model, tcp(robot), TaskRows::POSITION);
    let task = ManipulabilityTask::new(model, tcp(&start), TaskRows::POSITION).with(5.0, 1.0);
    let moved = run(&mut task.rate(rate));
    assert!(measure(&moved) > 1.02 * measure(&start), "{} {}", measure(&moved), measure(&start));

    let load = |robot: &Robot| {
        let mut effort = vec![0.0; robot.model.nv()];
        Dynamics::new(&robot.model).gravity(
            &robot.model,
            &robot.q,
            Vector3::new(0.0, 0.0, -9.81),
            &mut effort,
        );
        effort.iter().zip(robot.model.effort_limit()).map(|(g, limit)| (g / limit).powi(2)).sum::<f64>()
    };
    let task = MinimumEffortTask::new(model, Vector3::new(0.0, 0.0, -9.81)).with(10.0, 1.0);
    let moved = run(&mut task.rate(rate));
    assert!(load(&moved) < 0.8 * load(&start), "{} {}", load(&moved), load(&start));
}

#[test]
fn no_update_allocates() {
    let mut random = Random(66);
    let robot = Robot::new("humanoid").moved(&mut random);
    let (model, (a, b)) = (&robot.model, frames(&robot));
    let control = begun(&robot);
    let feedback = Feedback::critical(5.0);
    let tcp = TaskRows::POSITION;
    let mut tasks: Vec<Box<dyn AccelerationTask>> = vec![
        Box::new(RelativeTask::new(model, a, b).with(RelativeSettings::geometric()).feedback(feedback)),
        Box::new(UnicycleTask::new(model, a).rate(5.0)),
        Box::new(RollingTask::new(model, a, Vector3::y_axis(), 0.1).rate(5.0)),
        Box::new(RigidRotationTask::new(model, a, b, Vector3::y_axis()).feedback(feedback)),
        Box::new(ManipulabilityTask::new(model, b, tcp).rate(5.0)),
        Box::new(MinimumVelocityTask::new(model).rate(5.0)),
    ];
    let made = motorium::testing::allocations(|| {
        tasks.iter_mut().for_each(|task| task.update(&robot.state(), &control));
    });
    assert_eq!(made, 0);
}
