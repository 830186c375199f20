//! Pose weights per axis, and the regularisation of levels, with accelerations.

use motorium_control::tasks::Feedback;
use motorium_control::tasks::{CartesianSettings, CartesianTask, PostureTask};
use motorium_control::{
    inverse_dynamics::{AccelerationTask, InverseDynamics},
    tasks::{AxisShares, PoseAxes},
};
use motorium_robots::Twist;
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

use crate::robots::{Random, Robot};
use crate::tasks::rows;

const NONE: Feedback = Feedback { kp: 0.0, kd: 0.0 };

/// A moving target: pose, velocity and acceleration at time 0.
struct Moving {
    pose: Isometry3<f64>,
    velocity: Twist,
    acceleration: Twist,
}

impl Moving {
    fn pose_at(&self, t: f64) -> Isometry3<f64> {
        let half = 0.5 * t * t;
        let way = self.velocity.linear * t + self.acceleration.linear * half;
        let turn = self.velocity.angular * t + self.acceleration.angular * half;
        let rotation = UnitQuaternion::from_scaled_axis(turn) * self.pose.rotation;
        Isometry3::from_parts((self.pose.translation.vector + way).into(), rotation)
    }
}

#[test]
fn position_rows_are_second_derivatives_in_turning_axes() {
    let mut random = Random(91);
    for (name, link) in [("panda", "panda_hand_tcp"), ("humanoid", "left_palm"), ("quadruped", "base")] {
        for axes in [PoseAxes::Frame, PoseAxes::Target, PoseAxes::World] {
            let robot = Robot::new(name).moved(&mut random);
            let frame = robot.model.frame(link).unwrap();
            let mut control = InverseDynamics::new(&robot.model, Vec::new());
            control.begin(&robot.state(), 1e-3);
            let mut twist = || Twist { linear: random.vector(1.0), angular: random.vector(1.0) };
            let (velocity, acceleration) = (twist(), twist());
            let pose = Isometry3::from_parts(random.vector(1.0).into(), random.rotation());
            let target = Moving { pose, velocity, acceleration };
            let mut matrix = || Matrix3::from_fn(|_, _| random.within(1.0));
            let (position, orientation) = (matrix(), matrix());
            let shares = Some(AxisShares::matrices(axes, position, orientation));
            let weights = CartesianSettings { shares, ..CartesianSettings::geometric() };
            let mut task = CartesianTask::new(&robot.model, frame).with(weights).feedback(NONE);
            task.set_moving_target(pose, velocity, acceleration);
            task.update(&robot.state(), &control);
            let a = robot.accelerations(&mut random);
            let error = |t: f64| {
                let (at, target) =
                    (robot.after(&a, t).kinematics.pose(&robot.model, frame), target.pose_at(t));
                let from_world = match axes {
                    PoseAxes::Frame => at.rotation.inverse(),
                    PoseAxes::Target => target.rotation.inverse(),
                    PoseAxes::World => UnitQuaternion::identity(),
                };
                position * (from_world * (target.translation.vector - at.translation.vector))
            };
            let h = 2e-4;
            let expected = (error(h) - error(0.0) * 2.0 + error(-h)) / (h * h);
            let found = rows(task.cost(), &a);
            let close = 1e-5 * (1.0 + expected.norm());
            assert!(
                (found.fixed_rows::<3>(0) + expected).amax() < close,
                "{name} {axes:?}: {found} {expected}"
            );

            // the feedback uses the weighted error and its rate
            let rate = (error(h) - error(-h)) / (2.0 * h);
            let without = task.cost().desired().clone();
            task = task.feedback(Feedback { kp: 30.0, kd: 7.0 });
            task.update(&robot.state(), &control);
            let found = task.cost().desired() - without;
            let expected = error(0.0) * 30.0 + rate * 7.0;
            assert!(
                (found.fixed_rows::<3>(0) - expected).amax() < 1e-5,
                "{name} {axes:?}: {found} {expected}"
            );
        }
    }
}

#[test]
fn orientation_rows_are_the_rotated_and_weighted_pose_rows() {
    let mut random = Random(92);
    let robot = Robot::new("humanoid").moved(&mut random);
    let frame = robot.model.frame("left_palm").unwrap();
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    control.begin(&robot.state(), 1e-3);
    let target = Isometry3::from_parts(random.vector(1.0).into(), random.rotation());
    let mut whole = CartesianTask::new(&robot.model, frame)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(5.0));
    whole.set_target(target);
    whole.update(&robot.state(), &control);
    let a = robot.accelerations(&mut random);
    let whole = rows(whole.cost(), &a);
    let orientation = Matrix3::new(0.0, 0.5, 0.2, 0.0, 0.0, 0.0, 1.0, 0.0, -0.3);
    for (axes, from_world) in [
        (PoseAxes::Frame, robot.kinematics.pose(&robot.model, frame).rotation.inverse()),
        (PoseAxes::Target, target.rotation.inverse()),
        (PoseAxes::World, UnitQuaternion::identity()),
    ] {
        let shares = Some(AxisShares::matrices(axes, Matrix3::zeros(), orientation));
        let weights = CartesianSettings { shares, ..CartesianSettings::geometric() };
        let mut task =
            CartesianTask::new(&robot.model, frame).with(weights).feedback(Feedback::critical(5.0));
        task.set_target(target);
        task.update(&robot.state(), &control);
        let expected = orientation * (from_world * Vector3::from(whole.fixed_rows::<3>(3)));
        let found = rows(task.cost(), &a);
        assert!((found.fixed_rows::<3>(3) - expected).amax() < 1e-9, "{axes:?}: {found} {expected}");
        assert_eq!(task.cost().weights().as_slice(), [0.0, 0.0, 0.0, 0.5, 0.0, 0.5]);
    }
}

#[test]
fn level_is_affected_only_by_its_own_regularisation() {
    let robot = Robot::new("panda");
    let mut posture = PostureTask::new(&robot.model, &[0.1; 8]).feedback(Feedback::critical(1.0)).weight(0.5);
    let mut decided = |level: usize, damping: [f64; 2]| {
        let control = InverseDynamics::new(&robot.model, Vec::new());
        let mut control = control.levels(&[posture.rows(), posture.rows()]).level_damping(&damping);
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), level, &mut posture);
        (control.solve().unwrap().acceleration.clone(), posture.cost().desired().clone())
    };
    for level in [0, 1] {
        let mut damping = [1e-12; 2];
        damping[level] = 0.75;
        let (found, desired) = decided(level, damping);
        // 0.5^2 / (0.5^2 + 0.75)
        assert!((found - desired * 0.25).amax() < 1e-9, "level {level}");
    }
    let (found, desired) = decided(1, [0.75, 1e-12]);
    assert!((found - desired).amax() < 1e-9, "the regularisation of a higher level has no effect below");
}
