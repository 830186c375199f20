//! Springs and dampers that replace decay rates.

use motorium_control::inverse_dynamics::{AccelerationTask, InverseDynamics};
use motorium_control::tasks::Feedback;
use motorium_control::tasks::{CartesianImpedance, CartesianSettings, CartesianTask, PostureTask};
use motorium_robots::Reference;
use nalgebra::{DVector, Isometry3, Matrix6xX, Vector3, Vector6};

use crate::robots::{Random, Robot};

const SOFT: CartesianImpedance = CartesianImpedance {
    stiffness: 300.0,
    damping: 60.0,
    rotational_stiffness: 8.0,
    rotational_damping: 0.8,
};
const NONE: Feedback = Feedback { kp: 0.0, kd: 0.0 };

#[test]
fn spring_requests_the_acceleration_caused_by_its_force() {
    let mut random = Random(71);
    for (name, link) in [("panda", "panda_hand_tcp"), ("humanoid", "left_palm")] {
        let robot = Robot::new(name).moved(&mut random);
        let (model, frame) = (&robot.model, robot.model.frame(link).unwrap());
        let mut control = InverseDynamics::new(model, Vec::new());
        control.begin(&robot.state(), 1e-3);
        let pose = robot.kinematics.pose(model, frame);
        let target =
            Isometry3::from_parts((pose.translation.vector + random.vector(0.1)).into(), random.rotation());
        let asked = |task: CartesianTask| {
            let mut task = task;
            task.set_target(target);
            task.update(&robot.state(), &control);
            task.cost().desired().clone()
        };
        let without =
            asked(CartesianTask::new(model, frame).with(CartesianSettings::geometric()).feedback(NONE));
        let found = asked(
            CartesianTask::new(model, frame)
                .with(CartesianSettings::geometric())
                .feedback(NONE)
                .impedance(model, SOFT),
        ) - without;
        // by a dense inverse of the mass matrix
        let mut jacobian = Matrix6xX::zeros(model.nv());
        robot.kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut jacobian);
        let moving = robot.kinematics.velocity(model, frame);
        let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
        let force = (target.translation.vector - pose.translation.vector) * 300.0 - moving.linear * 60.0;
        let torque = turn * 8.0 - moving.angular * 0.8;
        let wrench = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        let mut mass = control.mass().clone();
        mass.fill_lower_triangle_with_upper_triangle();
        let inverse = mass.try_inverse().unwrap();
        let expected = &jacobian * &inverse * jacobian.transpose() * wrench;
        assert!((found - expected).amax() < 1e-8 * (1.0 + expected.amax()), "{name}: {expected}");

        let joints = model.joint_count();
        let stiffness: Vec<f64> = (0..joints).map(|joint| 10.0 + joint as f64).collect();
        let damping: Vec<f64> = (0..joints).map(|joint| 1.0 + 0.1 * joint as f64).collect();
        let mut posture = PostureTask::new(model, &vec![0.1; joints])
            .feedback(NONE)
            .weight(1.0)
            .impedance(model, &stiffness, &damping);
        posture.update(&robot.state(), &control);
        let (q, v) = (model.joints_of_q(&robot.q), model.joints_of_v(&robot.v));
        let base = model.nv() - joints;
        let efforts = DVector::from_fn(model.nv(), |row, _| match row.checked_sub(base) {
            None => 0.0,
            Some(joint) => stiffness[joint] * (0.1 - q[joint]) - damping[joint] * v[joint],
        });
        let expected = (inverse * efforts).rows(base, joints).into_owned();
        let found = posture.cost().desired() - &expected;
        assert!(found.amax() < 1e-8 * (1.0 + expected.amax()), "{name}: {found}");
    }
}

/// The robot at rest under a constant effort `push`, controlled by `task` and by a posture for the remaining
/// motions.
fn at_rest(
    mut robot: Robot,
    push: impl Fn(&Robot) -> DVector<f64>,
    task: &mut dyn AccelerationTask,
) -> Robot {
    let joints = robot.model.joint_count();
    let mut posture = PostureTask::new(&robot.model, &robot.q).feedback(Feedback::critical(5.0)).weight(1.0);
    let mut control = InverseDynamics::new(&robot.model, Vec::new()).levels(&[task.rows(), joints]);
    let dt = 1e-3;
    for _ in 0..6000 {
        control.begin(&robot.state(), dt);
        control.add_task(&robot.state(), 0, task);
        control.add_task(&robot.state(), 1, &mut posture);
        let commanded = control.solve().unwrap().acceleration.clone();
        // M (a - commanded) = push, which is unknown to the controller
        let mut mass = control.mass().clone();
        mass.fill_lower_triangle_with_upper_triangle();
        let pushed = mass.cholesky().unwrap().solve(&push(&robot));
        robot = robot.after(&(commanded + pushed), dt);
    }
    assert!(robot.v.iter().all(|v| v.abs() < 1e-3), "{:?}", robot.v);
    robot
}

#[test]
fn a_push_displaces_a_hand_by_force_over_stiffness() {
    let robot = Robot::new("panda");
    let (model, frame) = (robot.model.clone(), robot.model.frame("panda_hand_tcp").unwrap());
    let start = robot.kinematics.pose(&model, frame);
    for force in [Vector3::new(0.0, 9.0, 0.0), Vector3::new(6.0, 0.0, -6.0)] {
        let mut task = CartesianTask::new(&model, frame)
            .with(CartesianSettings::geometric())
            .feedback(NONE)
            .impedance(&model, SOFT);
        task.set_target(start);
        let push = |robot: &Robot| {
            let mut jacobian = Matrix6xX::zeros(model.nv());
            robot.kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut jacobian);
            jacobian.transpose() * Vector6::new(force.x, force.y, force.z, 0.0, 0.0, 0.0)
        };
        let end = at_rest(Robot::new("panda"), push, &mut task).kinematics.pose(&model, frame);
        let moved = end.translation.vector - start.translation.vector;
        assert!((moved - force / 300.0).norm() < 1e-4, "{moved} {force}");
        assert!(end.rotation.angle_to(&start.rotation) < 1e-3);
    }
}

#[test]
fn an_effort_turns_only_its_joint_by_effort_over_stiffness() {
    let robot = Robot::new("iiwa14");
    let (model, home) = (robot.model.clone(), robot.q.clone());
    let joints = model.joint_count();
    // springs and dampers proportional to the inertia of each joint
    let mut control = InverseDynamics::new(&model, Vec::new());
    control.begin(&robot.state(), 1e-3);
    let stiffness: Vec<f64> = control.mass().diagonal().iter().map(|mass| 60.0 * mass).collect();
    let damping: Vec<f64> = control.mass().diagonal().iter().map(|mass| 12.0 * mass).collect();
    let mut task =
        PostureTask::new(&model, &home).feedback(NONE).weight(1.0).impedance(&model, &stiffness, &damping);
    let push =
        |_: &Robot| DVector::from_fn(joints, |joint, _| if joint == 3 { 0.1 * stiffness[3] } else { 0.0 });
    let end = at_rest(robot, push, &mut task);
    for (joint, (end, home)) in end.q.iter().zip(&home).enumerate() {
        let expected = if joint == 3 { 0.1 } else { 0.0 };
        assert!((end - home - expected).abs() < 1e-3, "joint {joint}");
    }
}
