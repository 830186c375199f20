//! Closed kinematic loops: the joints follow the setpoint exactly, and every tick checks the limits.

use crate::robot::{ClosedLoop, Panda, Random};
use motorium_control::{
    DifferentialIk, IkError, RobotState,
    limits::{AccelerationLimit, Limit, PositionLimit, VelocityLimit},
    tasks::{CartesianSettings, CartesianTask},
};
use motorium_qp::{Problem, UpdateError};
use motorium_robots::{Kinematics, Twist, load};
use nalgebra::{DVector, Isometry3, Vector3};

const DT: f64 = 0.004;

#[test]
fn the_hand_reaches_goals_from_home_within_ten_micrometres() {
    let panda = Panda::new();
    let mut random = Random(1);
    for goal in 0..20 {
        let target = panda.hand_at(&panda.near_home(0.35, &mut random));
        let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
        reach.task.set_target(target);
        reach.run(4.0, DT);
        let (position, orientation) = (reach.task.position_error(), reach.task.orientation_error());
        assert!(position < 1e-5 && orientation < 1e-5, "goal {goal}: {position} m, {orientation} rad");
    }
}

#[test]
fn limits_hold_for_reachable_and_unreachable_goals() {
    let panda = Panda::new();
    let mut random = Random(2);
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    reach.velocity = VelocityLimit { fraction: 0.8 };
    for _ in 0..30 {
        let translation = Vector3::new(random.within(1.2), random.within(1.2), random.within(1.2));
        let rotation = Vector3::new(random.within(3.0), random.within(3.0), random.within(3.0));
        reach.task.set_target(Isometry3::new(translation, rotation));
        // every tick asserts the limits
        reach.run(0.8, DT);
    }
}

#[test]
fn a_joint_slows_down_towards_its_limit_and_keeps_its_margin() {
    let panda = Panda::new();
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    reach.position = PositionLimit { rate: 10.0, margin: 0.05 };
    let mut target = panda.hand_at(panda.home.as_slice());
    target.translation.vector += Vector3::new(2.0, 0.0, 0.0);
    reach.task.set_target(target);
    let elbow = panda.model.joint_index("panda_joint4").unwrap();
    let mut closest = f64::INFINITY;
    for _ in 0..1000 {
        let distance = panda.model.upper()[elbow] - 0.05 - reach.setpoint.position()[elbow];
        reach.tick(DT);
        let v = reach.setpoint.velocity()[elbow];
        assert!(v <= 10.0 * distance.max(0.0) + 1e-9, "{v} rad/s at {distance} rad");
        closest = closest.min(panda.model.upper()[elbow] - reach.setpoint.position()[elbow]);
    }
    assert!(closest > 0.05 - 1e-9, "{closest} rad");
}

#[test]
fn arm_is_calm_at_unreachable_targets() {
    let panda = Panda::new();
    let home = panda.hand_at(panda.home.as_slice());
    for far in [Vector3::new(2.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 3.0), Vector3::new(-1.5, 0.3, -1.0)] {
        for max_linear_speed in [0.5, f64::INFINITY] {
            let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
            reach.task.set_settings(CartesianSettings { max_linear_speed, ..Default::default() });
            let mut target = home;
            target.translation.vector += far;
            reach.task.set_target(target);
            reach.run(10.0, DT);
            for _ in 0..100 {
                let before = reach.setpoint.velocity().to_vec();
                reach.tick(DT);
                for (v, before) in reach.setpoint.velocity().iter().zip(&before) {
                    assert!(v.abs() < 0.1 && (v - before).abs() < 1e-3, "{far}: {v} after {before} rad/s");
                }
            }
        }
    }
}

#[test]
fn a_stretched_arm_leaves_its_singularity() {
    let panda = Panda::new();
    // elbow as straight as its limit allows, joints 5 and 7 almost parallel to their neighbours
    let start = [0.0, 0.0, 0.0, -0.0698, 0.0, 0.0, 0.0, 0.0];
    let mut reach = ClosedLoop::new(&panda, &start);
    // with much more weight on orientation the elbow stays at its limit: a local minimum of this motion
    reach.task.set_settings(CartesianSettings { orientation_weight: 0.1, ..Default::default() });
    reach.task.set_target(panda.hand_at(panda.home.as_slice()));
    reach.run(8.0, DT);
    assert!(reach.task.position_error() < 1e-5, "{} m", reach.task.position_error());
    assert!(reach.task.orientation_error() < 1e-4, "{} rad", reach.task.orientation_error());
}

#[test]
fn the_posture_moves_the_elbow_and_leaves_the_hand_in_place() {
    let panda = Panda::new();
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    let hand = panda.hand_at(panda.home.as_slice());
    reach.task.set_target(hand);
    let mut posture = panda.home.clone();
    posture[2] += 0.5;
    reach.posture.set_target(posture.as_slice());
    for _ in 0..1500 {
        reach.tick(DT);
        assert!(reach.task.position_error() < 2e-5, "{} m", reach.task.position_error());
    }
    assert!((reach.setpoint.position()[2] - panda.home[2]).abs() > 0.1, "{:?}", reach.setpoint.position());
}

#[test]
fn a_moving_target_of_known_velocity_is_followed_without_lag() {
    let panda = Panda::new();
    let centre = panda.hand_at(panda.home.as_slice());
    let (radius, rate) = (0.1, 2.0);
    let mut worst = [0.0_f64; 2];
    for (known, worst) in [false, true].into_iter().zip(&mut worst) {
        let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
        for tick in 0..2000 {
            let phase = rate * DT * f64::from(tick);
            let mut target = centre;
            target.translation.vector += Vector3::new(phase.cos() - 1.0, phase.sin(), 0.0) * radius;
            let velocity = Vector3::new(-phase.sin(), phase.cos(), 0.0) * radius * rate;
            let velocity = if known { velocity } else { Vector3::zeros() };
            let velocity = Twist { linear: velocity, angular: Vector3::zeros() };
            reach.task.set_moving_target(target, velocity, Twist::zero());
            reach.tick(DT);
            if tick > 500 {
                *worst = worst.max(reach.task.position_error());
            }
        }
    }
    let [lagging, following] = worst;
    // a first-order loop lags by speed / gain = 0.02 m
    assert!((0.015..0.025).contains(&lagging), "{lagging} m");
    assert!(following < 5e-4, "{following} m");
}

#[test]
fn a_joint_outside_its_limits_comes_back() {
    let panda = Panda::new();
    let mut start = panda.home.clone();
    start[1] = panda.model.lower()[1] - 0.2;
    let mut reach = ClosedLoop::new(&panda, start.as_slice());
    reach.task.set_target(panda.hand_at(panda.home.as_slice()));
    // `tick` asserts that it never goes farther
    reach.run(4.0, DT);
    assert!(reach.setpoint.position()[1] > panda.model.lower()[1]);
}

#[test]
fn fixed_joints_stand_still() {
    let panda = Panda::new();
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    reach.velocity = VelocityLimit { fraction: 0.0 };
    reach.task.set_target(Isometry3::translation(0.3, 0.2, 0.4));
    reach.run(0.1, DT);
    assert_eq!(reach.setpoint.position(), panda.home.as_slice());
}

#[test]
fn a_non_finite_state_or_target_stops_the_robot() {
    let panda = Panda::new();
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    let mut broken = panda.home.clone();
    broken[3] = f64::NAN;
    let refused = |reach: &mut ClosedLoop<'_>, q: &[f64]| {
        let mut kinematics = Kinematics::new(&panda.model);
        kinematics.update(&panda.model, q);
        let state = RobotState { model: &panda.model, kinematics: &kinematics, q };
        reach.ik.assemble(&state, &mut [&mut reach.task, &mut reach.posture], &[&reach.position], DT);
        let error = reach.ik.solve().unwrap_err();
        assert!(matches!(error, IkError::Pose(UpdateError::NotFinite { .. })), "{error}");
        assert!(reach.ik.velocity().iter().all(|v| *v == 0.0));
    };
    refused(&mut reach, broken.as_slice());
    reach.task.set_target(Isometry3::translation(f64::NAN, 0.0, 0.0));
    refused(&mut reach, panda.home.as_slice());
    reach.task.set_target(panda.hand_at(panda.home.as_slice()));
    reach.tick(DT);
}

#[test]
fn bounds_are_the_tightest_limits_and_allow_rest() {
    let panda = Panda::new();
    let mut q = panda.home.clone();
    q[0] = panda.model.upper()[0] - 0.01;
    q[1] = panda.model.upper()[1] + 0.1;
    q[2] = panda.model.lower()[2] - 0.1;
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, q.as_slice());
    let state = RobotState { model: &panda.model, kinematics: &kinematics, q: q.as_slice() };
    let mut problem = Problem::new(&motorium_control::DifferentialIk::structure(&panda.model));
    PositionLimit { rate: 20.0, margin: 0.0 }.intersect(&state, 0.001, &mut problem);
    VelocityLimit { fraction: 0.5 }.intersect(&state, 0.001, &mut problem);
    let half = 0.5 * panda.model.velocity_limit()[0];
    approx::assert_abs_diff_eq!(problem.upper[0], 0.2, epsilon = 1e-12);
    assert_eq!((problem.lower[0], problem.lower[1], problem.upper[1]), (-half, -half, 0.0));
    assert_eq!((problem.lower[2], problem.upper[2]), (0.0, half));

    // a rate faster than the tick would overshoot the limit
    let mut problem = Problem::new(&motorium_control::DifferentialIk::structure(&panda.model));
    PositionLimit { rate: 1e6, margin: 0.0 }.intersect(&state, 0.001, &mut problem);
    approx::assert_abs_diff_eq!(problem.upper[0], 10.0, epsilon = 1e-9);
}

#[test]
fn a_hand_stays_where_it_is_while_its_base_is_moved() {
    let humanoid = load("humanoid", std::path::Path::new(".")).unwrap();
    let (model, profile) = (&humanoid.model, humanoid.profile.unwrap());
    let q = profile.configuration(model, "standing").unwrap();
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q.as_slice());
    let state = RobotState { model, kinematics: &kinematics, q: q.as_slice() };
    let mut hand = CartesianTask::new(model, model.frame(&profile.end_effectors["left_hand"].frame).unwrap());
    hand.set_target(kinematics.pose(model, hand.frame()));
    let base = [0.1, -0.05, 0.02, 0.1, 0.05, -0.2];
    let limit =
        AccelerationLimit::new(model, DVector::repeat(model.joint_count(), 500.0), PositionLimit::default());

    let mut ik = DifferentialIk::new(model);
    ik.begin();
    ik.add_task(&state, 0, &mut hand);
    ik.add_limit(&state, &VelocityLimit::default(), DT);
    ik.add_acceleration_limit(&state, &limit, &vec![0.0; model.nv()], DT);
    for (index, velocity) in base.iter().enumerate() {
        ik.prescribe(index, *velocity);
    }
    let velocity = DVector::from_column_slice(ik.solve().unwrap());
    assert_eq!(velocity.as_slice()[..6], base);
    assert!((hand.jacobian() * &velocity).norm() < 1e-5, "{}", hand.jacobian() * velocity);
}
