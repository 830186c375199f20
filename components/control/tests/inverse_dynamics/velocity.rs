//! Tasks and limits at velocity level, on fixed and floating bases.

use motorium_control::{
    DifferentialIk, RobotState,
    limits::{
        CartesianVelocityLimit, CollisionLimit, CollisionSettings, PositionLimit, RowLimit, VelocityLimit,
    },
    tasks::{
        CartesianTask, CentreOfMassTask, ContactTask, ManipulabilityTask, MinimumVelocityTask, MomentumTask,
        PostureTask, RelativeTask, VelocityTask,
    },
};
use motorium_robots::{
    CollisionModel, CollisionOptions, Dynamics, Kinematics, Momentum, Reference, TaskRows,
};
use nalgebra::{DVector, Isometry3, Matrix6xX, Vector3, Vector6};

use crate::robots::{Random, Robot};

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

fn motion(robot: &Robot, random: &mut Random) -> DVector<f64> {
    DVector::from_fn(robot.model.nv(), |_, _| random.within(1.0))
}

/// `A v` of a cost, computed without `b`.
fn product(cost: &motorium_control::tasks::Cost, v: &DVector<f64>) -> DVector<f64> {
    let mut cost = cost.clone();
    cost.desired_mut().fill(0.0);
    DVector::from_fn(cost.rows(), |row, _| {
        let mut one = cost.clone();
        one.weights_mut().fill(0.0);
        one.weights_mut()[row] = 1.0;
        let length = one.residual(v.as_slice());
        one.desired_mut()[row] = 1e-3;
        if one.residual(v.as_slice()) <= length { length } else { -length }
    })
}

#[test]
fn the_relative_pose_error_changes_as_its_jacobian_predicts() {
    let mut random = Random(21);
    for (name, one, other) in
        [("humanoid", "left_palm", "right_palm"), ("panda", "panda_link3", "panda_hand_tcp")]
    {
        let robot = Robot::new(name).moved(&mut random);
        let frames = (robot.model.frame(one).unwrap(), robot.model.frame(other).unwrap());
        let target = Isometry3::from_parts(random.vector(0.3).into(), random.rotation());
        let error = |robot: &Robot| {
            let mut task = RelativeTask::new(&robot.model, frames.0, frames.1);
            task.set_target(target);
            task.update(&state(robot));
            (task.error(), task)
        };
        let (v, h) = (motion(&robot, &mut random), 1e-6);
        let rate: Vector6<f64> =
            (error(&moved(&robot, &v, h)).0 - error(&moved(&robot, &v, -h)).0) / (2.0 * h);
        let (_, task) = error(&robot);
        let found = -product(task.cost(), &v);
        assert!((&found - rate).amax() < 1e-6, "{name}: {found} {rate}");
        if robot.model.base().floating {
            let mut base = DVector::zeros(robot.model.nv());
            base.rows_mut(0, 6).copy_from(&v.rows(0, 6));
            assert!(product(task.cost(), &base).amax() < 1e-9);
        }
    }
}

#[test]
fn a_momentum_task_is_met_while_the_feet_stand() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let aim = Momentum { linear: Vector3::new(0.5, -1.0, 0.3), angular: Vector3::new(0.1, 0.2, -0.05) };
    let mut momentum = MomentumTask::angular(model).weights(1.0, 1.0);
    momentum.set_target(aim);
    let mut feet: Vec<_> =
        robot.feet().iter().map(|foot| ContactTask::surface(model, foot.frame).weight(10.0)).collect();
    let mut still = MinimumVelocityTask::new(model).weight(1e-3);
    let mut ik = DifferentialIk::new(model).levels(&[12, 6, model.nv()]);
    ik.begin();
    for foot in &mut feet {
        ik.add_task(&state(&robot), 0, foot);
    }
    ik.add_task(&state(&robot), 1, &mut momentum);
    ik.add_task(&state(&robot), 2, &mut still);
    let v = ik.solve().unwrap().to_vec();
    let found = Dynamics::new(model).momentum(model, &robot.q, &v);
    assert!((found.linear - aim.linear).norm() < 1e-3, "{found:?}");
    assert!((found.angular - aim.angular).norm() < 1e-3, "{found:?}");
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, &robot.q, &v);
    for foot in robot.feet() {
        let twist = kinematics.velocity(model, foot.frame).vector();
        assert!(twist.amax() < 1e-5, "{twist}");
    }
}

#[test]
fn point_contact_holds_its_origin_and_may_rotate() {
    let robot = Robot::new("quadruped");
    let model = &robot.model;
    let frame = model.frame("front_left_foot").unwrap();
    let mut point = ContactTask::point(model, frame);
    let mut ik = DifferentialIk::new(model).levels(&[point.rows(), model.nv()]);
    let mut wild = PostureTask::new(model, &vec![1.0; model.joint_count()]);
    ik.begin();
    ik.add_task(&state(&robot), 0, &mut point);
    ik.add_task(&state(&robot), 1, &mut wild);
    let v = ik.solve().unwrap().to_vec();
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, &robot.q, &v);
    let twist = kinematics.velocity(model, frame);
    assert!(twist.linear.norm() < 1e-6 && twist.angular.norm() > 1e-3, "{twist:?}");
}

#[test]
fn manipulability_grows_and_free_velocities_are_minimal() {
    let mut random = Random(22);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let frame = model.frame(if name == "panda" { "panda_hand_tcp" } else { "left_palm" }).unwrap();
        let mut task = ManipulabilityTask::new(model, frame, TaskRows::POSITION).with(1.0, 1.0);
        let mut ik = DifferentialIk::new(model);
        ik.begin();
        ik.add_task(&state(&robot), 0, &mut task);
        let v = DVector::from_column_slice(ik.solve().unwrap());
        let h = 1e-5;
        let measure =
            |robot: &Robot| robot.kinematics.manipulability(&robot.model, frame, TaskRows::POSITION);
        let rate = (measure(&moved(&robot, &v, h)) - measure(&moved(&robot, &v, -h))) / (2.0 * h);
        // v is the gradient, so the rate is its square
        assert!((rate - v.norm_squared()).abs() < 1e-4 * (1.0 + rate), "{name}: {rate} {}", v.norm_squared());
        assert!(rate > 0.0);
        assert_eq!(task.measure(), measure(&robot));
    }
}

#[test]
fn frame_speed_stays_within_its_limit_in_all_levels() {
    let mut random = Random(23);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let frame = model.frame(if name == "panda" { "panda_hand_tcp" } else { "left_palm" }).unwrap();
        let limit = CartesianVelocityLimit::new(model, frame, 0.1, f64::INFINITY);
        let mut reach = CartesianTask::new(model, frame);
        let mut target = robot.kinematics.pose(model, frame);
        target.translation.vector += Vector3::new(0.3, -0.2, 0.1);
        reach.set_target(target);
        let posture = PostureTask::new(model, &vec![0.3; model.joint_count()]);
        let fastest = |levels: &[usize], limited: bool| {
            let (mut reach, mut posture, mut limit) = (reach.clone(), posture.clone(), limit.clone());
            let mut ik = DifferentialIk::with_rows(model, limit.rows()).levels(levels);
            ik.begin();
            ik.add_task(&state(&robot), 0, &mut reach);
            ik.add_task(&state(&robot), levels.len() - 1, &mut posture);
            if limited {
                ik.add_row_limit(&state(&robot), &mut limit, 1e-3);
            }
            let v = DVector::from_column_slice(ik.solve().unwrap());
            let mut jacobian = Matrix6xX::zeros(model.nv());
            robot.kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut jacobian);
            (jacobian * v).fixed_rows::<3>(0).amax()
        };
        assert!(fastest(&[model.nv() + 6], false) > 0.5);
        for levels in [&[model.nv() + 6][..], &[6, model.nv()]] {
            let speed = fastest(levels, true);
            assert!(speed <= 0.1 + 1e-9 && speed > 0.0999, "{name}: {speed} m/s");
        }
    }
}

#[test]
fn links_stop_before_they_touch_each_other() {
    let mut robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let collisions = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    // links that are close by construction are ignored
    let mut near = motorium_robots::Collisions::new(&collisions);
    near.update(&collisions, &robot.kinematics);
    let close: Vec<usize> = near.within(&collisions, 0.05).iter().map(|pair| pair.pair).collect();
    let mut index = 0;
    let mut collisions = collisions;
    collisions.retain_pairs(|_| {
        index += 1;
        !close.contains(&(index - 1))
    });
    let settings = CollisionSettings { distance: 0.03, ..CollisionSettings::default() };
    let mut limit = CollisionLimit::new(&model, collisions, settings);
    let hand = model.frame("left_palm").unwrap();
    let mut reach = CartesianTask::new(&model, hand);
    // through the trunk of the body
    let mut target = robot.kinematics.pose(&model, hand);
    target.translation.vector.y = -0.1;
    reach.set_target(target);
    let feet: Vec<_> = robot.feet().iter().map(|foot| foot.frame).collect();
    let mut feet: Vec<_> =
        feet.into_iter().map(|foot| ContactTask::surface(&model, foot).weight(10.0)).collect();
    let mut centre = CentreOfMassTask::new(&model);
    centre.set_target(robot.kinematics.centre_of_mass(&model).position);
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    let (dt, mut smallest) = (5e-3, f64::INFINITY);
    for _ in 0..400 {
        let now = state(&robot);
        ik.begin();
        for foot in &mut feet {
            ik.add_task(&now, 0, foot);
        }
        ik.add_task(&now, 0, &mut centre);
        ik.add_task(&now, 0, &mut reach);
        ik.add_limit(&now, &PositionLimit::default(), dt);
        ik.add_limit(&now, &VelocityLimit::default(), dt);
        ik.add_row_limit(&now, &mut limit, dt);
        let step: Vec<f64> = ik.solve().unwrap().iter().map(|v| v * dt).collect();
        smallest = smallest.min(limit.smallest_distance().unwrap_or(f64::INFINITY));
        let from = robot.q.clone();
        model.integrate(&from, &step, &mut robot.q);
        robot.update();
    }
    assert!(smallest > 0.025, "{smallest} m");
    assert!(smallest < 0.04, "must come near the minimum distance: {smallest} m");
}
