//! Each task, compared with finite differences on fixed and floating bases, and with its equation.
//!
//! A task with the request `A x = b` predicts the second derivative of its quantity as `wanted + A x - b`.
//! Tests compare it with differences of the quantity along an accelerated motion.

use motorium_control::inverse_dynamics::{AccelerationTask, Contact, ContactShape, InverseDynamics};
use motorium_control::tasks::{
    AxisShares, CartesianSettings, CartesianTask, CentreOfMassTask, MomentumTask, PoseAxes, PostureTask,
    VelocityTask,
};
use motorium_control::tasks::{ContactForce, Cost, Feedback, ForceRegularisation, TorqueMinimum};
use motorium_robots::{Dynamics, Momentum, Twist};
use nalgebra::{DVector, Isometry3, UnitQuaternion, Vector3, Vector6};

use crate::robots::{Random, Robot};

const NONE: Feedback = Feedback { kp: 0.0, kd: 0.0 };
const H: f64 = 1e-5;

/// A fixed and a floating base.
const ROBOTS: [&str; 3] = ["panda", "humanoid", "quadruped"];

/// `A x - b` of all rows.
pub(crate) fn rows(cost: &Cost, x: &DVector<f64>) -> DVector<f64> {
    let mut one = cost.clone();
    DVector::from_fn(cost.rows(), |row, _| {
        one.weights_mut().fill(0.0);
        one.weights_mut()[row] = 1.0;
        // residuals are norms, so the sign comes from a shifted right-hand side
        let length = one.residual(x.as_slice());
        one.desired_mut()[row] += 1e-3;
        let shifted = one.residual(x.as_slice());
        one.desired_mut()[row] -= 1e-3;
        if shifted <= length { length } else { -length }
    })
}

fn frame_of(robot: &Robot) -> motorium_robots::FrameId {
    let model = &robot.model;
    model.frame(&model.frames().last().unwrap().name).unwrap()
}

#[test]
fn cartesian_task_without_gains_requests_no_acceleration() {
    let mut random = Random(1);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let (frame, mut dynamics) = (frame_of(&robot), InverseDynamics::new(&robot.model, Vec::new()));
        dynamics.begin(&robot.state(), 1e-3);
        let mut task =
            CartesianTask::new(&robot.model, frame).with(CartesianSettings::geometric()).feedback(NONE);
        AccelerationTask::update(&mut task, &robot.state(), &dynamics);
        let a = robot.accelerations(&mut random);
        let velocity = |dt: f64| {
            let next = robot.after(&a, dt);
            next.kinematics.velocity(&next.model, frame).vector()
        };
        let expected: Vector6<f64> = (velocity(H) - velocity(-H)) / (2.0 * H);
        let found = rows(task.cost(), &a);
        assert!((&found - expected).amax() < 1e-5, "{name}: {found} {expected}");
    }
}

#[test]
fn logarithmic_errors_accelerate_as_predicted() {
    let mut random = Random(7);
    let all = [None, Some(PoseAxes::Frame), Some(PoseAxes::Target), Some(PoseAxes::World)];
    for (name, axes) in ROBOTS.into_iter().flat_map(|name| all.map(|axes| (name, axes))) {
        let robot = Robot::new(name).moved(&mut random);
        let (model, frame) = (&robot.model, frame_of(&robot));
        let mut control = InverseDynamics::new(model, Vec::new());
        control.begin(&robot.state(), 1e-3);
        let shares = axes.map(|axes| AxisShares::new(axes, [1.0; 3], [1.0; 3]));
        let mut task = CartesianTask::new(model, frame)
            .with(CartesianSettings { shares, ..CartesianSettings::default() })
            .feedback(NONE);
        let near = Isometry3::new(random.vector(0.3), random.vector(0.8));
        let target = robot.kinematics.pose(model, frame) * near;
        let twist = Twist { linear: random.vector(1.0), angular: random.vector(1.0) };
        let rate = Twist { linear: random.vector(1.0), angular: random.vector(1.0) };
        task.set_moving_target(target, twist, rate);
        AccelerationTask::update(&mut task, &robot.state(), &control);
        let a = robot.accelerations(&mut random);
        let error = |time: f64| {
            let turn = twist.angular * time + rate.angular * (0.5 * time * time);
            let way = twist.linear * time + rate.linear * (0.5 * time * time);
            let rotation = UnitQuaternion::from_scaled_axis(turn) * target.rotation;
            let mut later = task.clone();
            later.set_target(Isometry3::from_parts((target.translation.vector + way).into(), rotation));
            let next = robot.after(&a, time);
            VelocityTask::update(&mut later, &next.state().robot());
            later.error()
        };
        let h = 1e-3;
        let expected = (error(h) - error(0.0) * 2.0 + error(-h)) / (h * h);
        let found = rows(task.cost(), &a);
        let close = 1e-4 * (1.0 + expected.norm());
        assert!((&found + expected).amax() < close, "{name} {axes:?}: {found} {expected}");
        // the feedback acts on the error and its rate
        let without = task.cost().desired().clone();
        let mut task = task.clone().feedback(Feedback { kp: 30.0, kd: 7.0 });
        AccelerationTask::update(&mut task, &robot.state(), &control);
        let expected = error(0.0) * 30.0 + (error(h) - error(-h)) / (2.0 * h) * 7.0;
        let found = task.cost().desired() - without;
        assert!((found - expected).amax() < close, "{name} {axes:?}: {expected}");
    }
}

#[test]
fn centre_of_mass_and_momentum_accelerate_as_commanded() {
    let mut random = Random(2);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let mut control = InverseDynamics::new(model, Vec::new());
        control.begin(&robot.state(), 1e-3);
        let a = robot.accelerations(&mut random);
        let (ahead, behind) = (robot.after(&a, H), robot.after(&a, -H));
        let mut centre = CentreOfMassTask::new(model).feedback(NONE);
        AccelerationTask::update(&mut centre, &robot.state(), &control);
        let velocity = |robot: &Robot| robot.kinematics.centre_of_mass(model).velocity;
        let expected = (velocity(&ahead) - velocity(&behind)) / (2.0 * H);
        assert!((rows(centre.cost(), &a) - expected).amax() < 1e-5, "{name}");

        let mut momentum = MomentumTask::angular(model).rate(0.0).weights(1.0, 1.0);
        AccelerationTask::update(&mut momentum, &robot.state(), &control);
        let mut dynamics = Dynamics::new(model);
        let mut of = |robot: &Robot| dynamics.momentum(model, &robot.q, &robot.v);
        let (ahead, behind) = (of(&ahead), of(&behind));
        let found = rows(momentum.cost(), &a);
        let (linear, angular) =
            ((ahead.linear - behind.linear) / (2.0 * H), (ahead.angular - behind.angular) / (2.0 * H));
        assert!((found.fixed_rows::<3>(0) - linear).amax() < 1e-3, "{name}: {found} {linear}");
        assert!((found.fixed_rows::<3>(3) - angular).amax() < 1e-3, "{name}: {found} {angular}");
    }
}

#[test]
fn feedback_signs_move_towards_the_target() {
    let mut random = Random(3);
    let feedback = Feedback { kp: 30.0, kd: 7.0 };
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let (model, frame) = (&robot.model, frame_of(&robot));
        let mut control = InverseDynamics::new(model, Vec::new());
        control.begin(&robot.state(), 1e-3);
        let still = DVector::zeros(model.nv());
        let drift = robot.kinematics.acceleration(model, frame).vector();

        let target = Isometry3::from_parts(random.vector(1.0).into(), random.rotation());
        let twist = Twist { linear: random.vector(1.0), angular: random.vector(1.0) };
        let rate = Twist { linear: random.vector(1.0), angular: random.vector(1.0) };
        let mut task =
            CartesianTask::new(model, frame).with(CartesianSettings::geometric()).feedback(feedback);
        task.set_moving_target(target, twist, rate);
        AccelerationTask::update(&mut task, &robot.state(), &control);
        let pose = robot.kinematics.pose(model, frame);
        let moving = robot.kinematics.velocity(model, frame);
        let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
        let linear = rate.linear
            + (target.translation.vector - pose.translation.vector) * 30.0
            + (twist.linear - moving.linear) * 7.0;
        let angular = rate.angular + turn * 30.0 + (twist.angular - moving.angular) * 7.0;
        let found = -rows(task.cost(), &still) + DVector::from_column_slice(drift.as_slice());
        assert!((found.fixed_rows::<3>(0) - linear).amax() < 1e-9, "{name}");
        assert!((found.fixed_rows::<3>(3) - angular).amax() < 1e-9, "{name}");

        let goal: Vec<f64> = (0..model.joint_count()).map(|_| random.within(1.0)).collect();
        let mut posture = PostureTask::new(model, &goal).feedback(feedback).weight(1.0);
        AccelerationTask::update(&mut posture, &robot.state(), &control);
        let (q, v) = (model.joints_of_q(&robot.q), model.joints_of_v(&robot.v));
        for (joint, found) in posture.cost().desired().iter().enumerate() {
            let expected = 30.0 * (goal[joint] - q[joint]) - 7.0 * v[joint];
            assert!((found - expected).abs() < 1e-12, "{name}");
        }

        let mut momentum = MomentumTask::angular(model).rate(2.0).weights(1.0, 1.0);
        let aim = Momentum { linear: random.vector(1.0), angular: random.vector(1.0) };
        let push = Momentum { linear: random.vector(1.0), angular: random.vector(1.0) };
        momentum.set_moving_target(aim, push);
        AccelerationTask::update(&mut momentum, &robot.state(), &control);
        let mut dynamics = Dynamics::new(model);
        let now = dynamics.momentum(model, &robot.q, &robot.v);
        let drift = dynamics.momentum_rate(model, &robot.q, &robot.v, &vec![0.0; model.nv()]);
        let expected = push.angular + (aim.angular - now.angular) * 2.0 - drift.angular;
        assert!((momentum.cost().desired().fixed_rows::<3>(3) - expected).amax() < 1e-9, "{name}");
    }
}

#[test]
fn a_correction_is_exact_below_its_maximum_speed() {
    let feedback = Feedback { kp: 100.0, kd: 20.0 };
    let far = Vector3::new(3.0, 4.0, 0.0);
    let found = feedback.acceleration(&far, &Vector3::zeros(), 0.5);
    assert!((found - Vector3::new(6.0, 8.0, 0.0)).norm() < 1e-12, "{found}");
    // at that speed no acceleration remains
    let moving = feedback.acceleration(&far, &-Vector3::new(0.3, 0.4, 0.0), 0.5);
    assert!(moving.norm() < 1e-12);
    let near = feedback.acceleration(&(far * 0.01), &Vector3::zeros(), 0.5);
    assert!((near - far).norm() < 1e-12);
}

#[test]
fn position_task_leaves_the_orientation_free() {
    let robot = Robot::new("panda");
    let frame = frame_of(&robot);
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    control.begin(&robot.state(), 1e-3);
    let weights = CartesianSettings { orientation_weight: 0.0, ..CartesianSettings::geometric() };
    let mut task = CartesianTask::new(&robot.model, frame).with(weights).feedback(Feedback::critical(5.0));
    let mut target = robot.kinematics.pose(&robot.model, frame);
    target.rotation *= nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(1.0, 0.0, 0.0));
    task.set_target(target);
    control.add_task(&robot.state(), 0, &mut task);
    assert!(control.solve().unwrap().acceleration.amax() < 1e-6, "only the orientation is off");
}

#[test]
fn forces_follow_their_target_or_are_spread_evenly() {
    let robot = Robot::new("humanoid");
    let weight = robot.model.mass() * 9.81;
    let mut control = InverseDynamics::new(&robot.model, robot.feet());
    let state = robot.state();
    let mut posture =
        PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    let mut centre = CentreOfMassTask::new(&robot.model).feedback(Feedback::critical(5.0));
    centre.set_target(robot.kinematics.centre_of_mass(&robot.model).position);
    let mut even = ForceRegularisation::new(&control).weight(1e-3);
    control.begin(&state, 1e-3);
    control.add_task(&state, 0, &mut posture);
    control.add_task(&state, 0, &mut centre);
    control.add_task(&state, 0, &mut even);
    control.solve().unwrap();
    let (left, right) = (control.wrench(0).linear.z, control.wrench(1).linear.z);
    assert!((left - right).abs() < 1e-3 * weight, "{left} {right}");
    assert!((left + right - weight).abs() < 1e-2 * weight);

    let mut push = ContactForce::new(&control, 0).weight(10.0);
    push.set_target(Vector3::new(0.0, 0.0, 0.6 * weight));
    control.begin(&state, 1e-3);
    control.add_task(&state, 0, &mut posture);
    control.add_task(&state, 0, &mut centre);
    control.add_task(&state, 0, &mut push);
    control.solve().unwrap();
    let found = control.wrench(0).linear;
    assert!((found - Vector3::new(0.0, 0.0, 0.6 * weight)).norm() < 0.01 * weight, "{found}");
    assert!(control.residual(&push) < 0.01 * weight);
}

#[test]
fn the_torque_residual_matches_inverse_dynamics() {
    let mut random = Random(5);
    for name in ROBOTS {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let mut control = InverseDynamics::new(model, Vec::new());
        control.begin(&robot.state(), 1e-3);
        let mut task = TorqueMinimum::new(model, &control);
        AccelerationTask::update(&mut task, &robot.state(), &control);
        let a = robot.accelerations(&mut random);
        let mut tau = vec![0.0; model.nv()];
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        Dynamics::new(model).rnea(model, &robot.q, &robot.v, a.as_slice(), gravity, &mut tau);
        let found = rows(task.cost(), &a);
        let expected = DVector::from_column_slice(model.joints_of_v(&tau));
        assert!((&found - &expected).amax() < 1e-6 * (1.0 + expected.amax()), "{name}");
    }
}

#[test]
fn a_rolling_ball_is_at_rest_at_its_contact_point() {
    let mut random = Random(6);
    let robot = Robot::new("quadruped").moved(&mut random);
    let model = &robot.model;
    let foot = &robot.profile.feet["hind_right"];
    let frame = model.frame(&foot.frame).unwrap();
    for (shape, radius) in [(ContactShape::Point, 0.0), (ContactShape::Ball { radius: 0.0165 }, 0.0165)] {
        let mut control = InverseDynamics::new(model, vec![Contact::new("foot", frame, shape)]);
        control.begin(&robot.state(), 1e-3);
        let a = robot.accelerations(&mut random);
        let arm = Vector3::new(0.0, 0.0, -radius);
        let velocity = |dt: f64| {
            let next = robot.after(&a, dt);
            let twist = next.kinematics.velocity(model, frame);
            twist.linear + twist.angular.cross(&arm)
        };
        let expected = (velocity(H) - velocity(-H)) / (2.0 * H);
        let problem = control.problem();
        let damping = control.settings().contact_damping;
        for axis in 0..3 {
            let row = problem.equality_matrix.row(6 + axis);
            let product: f64 = row.iter().zip(a.iter()).map(|(row, a)| row * a).sum();
            let found = product - problem.equality_value[6 + axis] - damping * velocity(0.0)[axis];
            assert!((found - expected[axis]).abs() < 1e-5, "{shape:?}: {found} {expected}");
        }
    }
}
