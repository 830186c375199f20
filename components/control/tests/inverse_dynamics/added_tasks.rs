//! Wheel, effort and force tasks for velocities; tasks as constraints; limits as tasks.

use motorium_control::tasks::CartesianSettings;
use motorium_control::tasks::Feedback;
use motorium_control::{
    DifferentialIk, IkRows, IkSettings, RobotState,
    inverse_dynamics::{DynamicsRows, InverseDynamics, InverseDynamicsSettings},
    limits::{CartesianVelocityLimit, RowLimit, VelocityLimit},
    tasks::{
        CartesianTask, ContactTask, ManipulabilityTask, MinimumEffortTask, MinimumVelocityTask, PostureTask,
        RigidRotationTask, RollingTask, UnicycleSettings, UnicycleTask, VelocityTask,
    },
};
use motorium_robots::{Dynamics, Kinematics, Reference, TaskRows};
use nalgebra::{DVector, Matrix6xX, Vector3};

use crate::robots::{Random, Robot};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn state(robot: &Robot) -> RobotState<'_> {
    RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q }
}

/// The robot after a unit of time `h` with the velocity `v`.
fn moved(robot: &Robot, v: &DVector<f64>, h: f64) -> Robot {
    let mut next = Robot::new(robot.model.name());
    next.model.integrate(&robot.q, (v * h).as_slice(), &mut next.q);
    next.update();
    next
}

/// Velocity requested by a single task.
fn alone(robot: &Robot, task: &mut dyn VelocityTask) -> DVector<f64> {
    let mut ik = DifferentialIk::new(&robot.model);
    ik.begin();
    ik.add_task(&state(robot), 0, task);
    DVector::from_column_slice(ik.solve().unwrap())
}

/// Rate of a quantity of the robot along a velocity.
fn rate(robot: &Robot, v: &DVector<f64>, figure: impl Fn(&Robot) -> f64) -> f64 {
    let h = 1e-5;
    (figure(&moved(robot, v, h)) - figure(&moved(robot, v, -h))) / (2.0 * h)
}

#[test]
fn force_manipulability_grows_as_velocity_shrinks() {
    let mut random = Random(31);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let frame = robot.model.frame(if name == "panda" { "panda_hand_tcp" } else { "left_palm" }).unwrap();
        let rows = TaskRows::POSITION;
        let mut task = ManipulabilityTask::new(&robot.model, frame, rows).of_forces().with(1e-2, 1.0);
        let v = alone(&robot, &mut task);
        let of = |robot: &Robot| robot.kinematics.manipulability(&robot.model, frame, rows);
        assert!((task.measure() - of(&robot).recip()).abs() < 1e-9 * task.measure());
        let (grows, falls) = (rate(&robot, &v, |robot| of(robot).recip()), rate(&robot, &v, of));
        // v is a hundredth of the gradient, so the rate is a hundred times its square
        let expected = 100.0 * v.norm_squared();
        assert!((grows - expected).abs() < 1e-4 * (1.0 + expected), "{name}: {grows} {expected}");
        assert!(grows > 0.0 && falls < 0.0, "{name}: {grows} {falls}");
        let v = alone(&robot, &mut task.max_speed(1e-3));
        assert!((v.norm() - 1e-3).abs() < 1e-8, "speed above its limit: {}", v.norm());
    }
}

#[test]
fn holding_efforts_fall_along_their_task() {
    let mut random = Random(32);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let measure = |robot: &Robot| {
            let mut effort = vec![0.0; model.nv()];
            Dynamics::new(model).gravity(model, &robot.q, GRAVITY, &mut effort);
            let of_joints = model.joints_of_v(&effort).iter().zip(model.effort_limit());
            0.5 * of_joints.map(|(effort, limit)| (effort / limit).powi(2)).sum::<f64>()
        };
        let mut task = MinimumEffortTask::new(model, GRAVITY).with(1.0, 1.0);
        let v = alone(&robot, &mut task);
        assert!((task.measure() - measure(&robot)).abs() < 1e-9 * task.measure());
        let (falls, expected) = (rate(&robot, &v, measure), -v.norm_squared());
        assert!((falls - expected).abs() < 1e-4 * -expected, "{name}: {falls} {expected}");
        assert!(v.norm() > 1e-4, "{name}: the task must request motion: {}", v.norm());
    }
}

#[test]
fn unicycle_drives_at_its_velocity_in_its_own_axes() {
    let mut random = Random(33);
    let robot = Robot::new("quadruped").moved(&mut random);
    let model = &robot.model;
    let frame = model.frame("base").unwrap();
    let settings = UnicycleSettings { forward: 0.7, yaw_rate: -0.4, ..UnicycleSettings::default() };
    let v = alone(&robot, &mut UnicycleTask::new(model, frame).with(settings));
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, &robot.q, v.as_slice());
    let turn = kinematics.pose(model, frame).rotation.inverse();
    let twist = kinematics.velocity(model, frame);
    let (linear, angular) = (turn * twist.linear, turn * twist.angular);
    assert!((linear.x - 0.7).abs() < 1e-5 && linear.y.abs() < 1e-5, "{linear}");
    assert!((angular.z + 0.4).abs() < 1e-5, "{angular}");
    // uncontrolled motion is left to other tasks
    let free = UnicycleSettings { forward_weight: 0.0, yaw_weight: 0.0, ..settings };
    let v = alone(&robot, &mut UnicycleTask::new(model, frame).with(free));
    assert!(v.norm() < 1e-9, "{v}");
}

#[test]
fn a_steered_wheel_rolls_backwards_if_that_is_closer() {
    // the hand of the arm points down, so its last joint steers about the vertical
    let robot = Robot::new("panda");
    let model = &robot.model;
    let (wheel, base) = (model.frame("panda_hand").unwrap(), model.frame("panda_link0").unwrap());
    let axis = Vector3::y_axis();
    for (x, y) in [(0.3, 0.0), (0.2, 0.25), (-0.3, 0.1), (0.0, -0.2)] {
        let mut robot = Robot::new("panda");
        let mut task = RigidRotationTask::new(model, wheel, base, axis);
        task.set_twist(x, y, 0.0);
        let mut still = MinimumVelocityTask::new(model).weight(1e-4);
        for _ in 0..300 {
            let mut ik = DifferentialIk::new(model);
            ik.begin();
            ik.add_task(&state(&robot), 0, &mut task);
            ik.add_task(&state(&robot), 0, &mut still);
            let v = DVector::from_column_slice(ik.solve().unwrap());
            robot = moved(&robot, &v, 5e-3);
        }
        let forward = (robot.kinematics.pose(model, wheel).rotation * *axis).cross(&Vector3::z());
        let across = forward.x * y - forward.y * x;
        assert!(across.abs() < 1e-4 * x.hypot(y), "{x} {y}: {forward}");
    }
    // a turning base also moves the centre of the wheel
    let mut task = RigidRotationTask::new(model, wheel, base, axis).with(2.0, 1.0);
    task.set_twist(0.1, 0.0, 0.5);
    task.update(&state(&robot));
    let pose = robot.kinematics.pose(model, wheel);
    let (p, forward) = (pose.translation.vector, (pose.rotation * *axis).cross(&Vector3::z()));
    let way = (0.5 * p.x).atan2(0.1 - 0.5 * p.y);
    let turn = way - forward.y.atan2(forward.x);
    let error = turn - std::f64::consts::PI * (turn / std::f64::consts::PI).round();
    assert!((task.error() - error).abs() < 1e-9, "{} {error}", task.error());
    assert!((task.cost().desired()[0] - (2.0 * error + 0.5)).abs() < 1e-9);
    task.set_twist(0.0, 0.0, 0.0);
    task.update(&state(&robot));
    assert_eq!((task.error(), task.cost().weights()[0]), (0.0, 0.0), "a standing wheel requests nothing");
}

#[test]
fn a_task_as_a_constraint_holds_exactly() {
    let mut random = Random(34);
    let robot = Robot::new("panda").moved(&mut random);
    let model = &robot.model;
    let hand = model.frame("panda_hand_tcp").unwrap();
    let mut target = robot.kinematics.pose(model, hand);
    target.translation.vector += Vector3::new(0.01, -0.02, 0.01);
    let mut held = CartesianTask::new(model, hand);
    held.set_target(target);
    let mut against = PostureTask::new(model, &vec![1.0; model.nv()]);
    against.set_settings(motorium_control::tasks::PostureSettings { gain: 5.0, weight: 100.0 });
    let room = IkRows { held: held.rows(), ..IkRows::default() };
    for levels in [&[][..], &[model.nv(), model.nv()]] {
        let mut ik = DifferentialIk::with_room(model, room, IkSettings::default()).levels(levels);
        let mut second = MinimumVelocityTask::new(model);
        ik.begin();
        ik.constrain(&state(&robot), &mut held);
        ik.add_task(&state(&robot), 0, &mut against);
        ik.add_task(&state(&robot), levels.len().saturating_sub(1), &mut second);
        let v = DVector::from_column_slice(ik.solve().unwrap());
        assert!((held.jacobian() * &v - held.desired()).amax() < 1e-9);
        assert!((&v - alone(&robot, &mut held)).norm() > 0.1, "the posture moves the elbow");
    }
    // a constraint that no velocity satisfies leaves no solution
    target.translation.vector.x += 1.0;
    held.set_target(target);
    let mut ik = DifferentialIk::with_room(model, room, IkSettings::default());
    ik.begin();
    ik.constrain(&state(&robot), &mut held);
    ik.add_limit(&state(&robot), &VelocityLimit { fraction: 0.1 }, 1e-3);
    assert!(ik.solve().is_err());
}

#[test]
fn a_torque_task_as_a_constraint_holds_or_is_relaxed() {
    let mut random = Random(35);
    let robot = Robot::new("humanoid").moved(&mut random);
    let model = &robot.model;
    let palm = model.frame("left_palm").unwrap();
    // the target of the last case is ten kilometres away and exceeds the iteration limit of a step
    let settings = InverseDynamicsSettings { max_iterations: 100_000, ..InverseDynamicsSettings::default() };
    for (off, levels) in [(0.01, &[][..]), (0.01, &[64, 64]), (1e4, &[])] {
        let mut target = robot.kinematics.pose(model, palm);
        target.translation.vector.x += off;
        let mut held = CartesianTask::new(model, palm)
            .with(CartesianSettings::geometric())
            .feedback(Feedback::critical(10.0));
        held.set_target(target);
        let mut posture =
            PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
        let room = DynamicsRows { constrained: 6, limits: 0 };
        let mut control = InverseDynamics::with_room(model, robot.feet(), settings, room).levels(levels);
        control.begin(&robot.state(), 1e-3);
        control.constrain(&robot.state(), &mut held);
        control.add_task(&robot.state(), levels.len().saturating_sub(1), &mut posture);
        let slack = control.solve().unwrap().slack;
        let residual = control.residual(&held);
        match off < 1.0 {
            true => assert!(residual < 1e-7 && slack.is_none(), "{residual} {slack:?}"),
            false => assert!(slack.unwrap().task > 1.0, "{slack:?}"),
        }
    }
}

#[test]
fn a_limit_as_a_task_yields_to_higher_levels_only() {
    let mut random = Random(36);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let frame = model.frame(if name == "panda" { "panda_hand_tcp" } else { "left_palm" }).unwrap();
        let mut reach = CartesianTask::new(model, frame);
        let mut target = robot.kinematics.pose(model, frame);
        target.translation.vector += Vector3::new(0.05, 0.0, 0.0);
        reach.set_target(target);
        let mut limit = CartesianVelocityLimit::new(model, frame, 0.1, f64::INFINITY);
        let rows = limit.rows();
        let mut speed = |task: usize, soft: usize, weight: f64| {
            let room = IkRows { soft: rows, ..IkRows::default() };
            let levels: &[usize] = if task == soft { &[] } else { &[6 + rows, 6 + rows] };
            let mut ik = DifferentialIk::with_room(model, room, IkSettings::default()).levels(levels);
            ik.begin();
            ik.add_task(&state(&robot), task, &mut reach);
            ik.add_soft_limit(&state(&robot), soft, &mut limit, weight, 1e-3);
            let v = DVector::from_column_slice(ik.solve().unwrap());
            let mut jacobian = Matrix6xX::zeros(model.nv());
            robot.kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut jacobian);
            let slack = ik.slack().iter().fold(0.0_f64, |most, slack| most.max(slack.abs()));
            ((jacobian * v)[0], slack)
        };
        let (above, slack) = speed(0, 1, 1.0);
        assert!(above > 0.4 && (slack - (above - 0.1)).abs() < 1e-6, "{name}: {above} {slack}");
        let (below, slack) = speed(1, 0, 1.0);
        assert!(below < 0.1 + 1e-4 && below > 0.09 && slack < 1e-4, "{name}: {below} {slack}");
        let (beside, _) = speed(0, 0, 1.0);
        assert!(beside > 0.15 && beside < above - 0.05, "{name}: {beside}");
        let (heavy, _) = speed(0, 0, 1e3);
        assert!(heavy < 0.1 + 1e-3, "{name}: {heavy}");
    }
}

#[test]
fn wheel_constraint_and_limit_tasks_do_not_allocate() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let frame = model.frame("left_palm").unwrap();
    let (mut effort, mut unicycle) =
        (MinimumEffortTask::new(model, GRAVITY), UnicycleTask::new(model, frame));
    let mut rolling = RollingTask::new(model, frame, Vector3::y_axis(), 0.1);
    let mut steer = RigidRotationTask::new(model, frame, frame, Vector3::y_axis());
    let mut foot = ContactTask::surface(model, model.frame("left_sole").unwrap());
    let mut limit = CartesianVelocityLimit::new(model, frame, 0.1, 1.0);
    let room = IkRows { held: 6, limits: 0, soft: limit.rows() };
    let mut ik = DifferentialIk::with_room(model, room, IkSettings::default()).levels(&[64, 64]);
    let allocations = motorium::testing::allocations(|| {
        for _ in 0..3 {
            let now = state(&robot);
            ik.begin();
            ik.constrain(&now, &mut foot);
            let tasks: [&mut dyn VelocityTask; 4] = [&mut effort, &mut unicycle, &mut rolling, &mut steer];
            for (place, task) in tasks.into_iter().enumerate() {
                ik.add_task(&now, place % 2, task);
            }
            ik.add_soft_limit(&now, 1, &mut limit, 1.0, 1e-3);
            ik.solve().unwrap();
        }
    });
    assert_eq!(allocations, 0);
}
