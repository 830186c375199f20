//! Equations of motion, friction, limits, levels, and conflicts.

use motorium_control::inverse_dynamics::{
    ConstraintName, InverseDynamics, InverseDynamicsError, InverseDynamicsSettings, JointAccelerationLimits,
};
use motorium_control::tasks::{CartesianSettings, CartesianTask, CentreOfMassTask, PostureTask};
use motorium_control::tasks::{Feedback, ForceRegularisation};
use motorium_qp::KktResidual;
use motorium_robots::{Dynamics, Wrench};
use nalgebra::{DVector, Vector3};

use crate::robots::{Random, Robot};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// Torques by Newton-Euler for the accelerations and contact wrenches of a solution; the base's entries
/// first.
fn newton_euler(robot: &Robot, control: &InverseDynamics) -> Vec<f64> {
    let model = &robot.model;
    let wrenches: Vec<_> = control
        .contacts()
        .enumerate()
        .map(|(index, contact)| {
            // wrenches of the dynamics are given in the axes of their frame
            let turn = robot.kinematics.pose(model, contact.frame).rotation.inverse();
            let wrench = control.wrench(index);
            (contact.frame, Wrench { force: turn * wrench.linear, moment: turn * wrench.angular })
        })
        .collect();
    let mut tau = vec![0.0; model.nv()];
    let a = control.solution().acceleration.as_slice();
    Dynamics::new(model).rnea_external(model, &robot.q, &robot.v, a, GRAVITY, &wrenches, &mut tau);
    tau
}

#[test]
fn solutions_satisfy_an_independent_equation_of_motion() {
    let mut random = Random(11);
    for name in ["humanoid", "quadruped", "biped", "panda"] {
        for _ in 0..5 {
            let robot = Robot::new(name).moved(&mut random);
            let model = &robot.model;
            let settings = InverseDynamicsSettings { relaxation: None, ..InverseDynamicsSettings::default() };
            let settings = InverseDynamicsSettings {
                joints: JointAccelerationLimits { max_acceleration: 1e6, ..settings.joints },
                torque_fraction: 1e3,
                ..settings
            };
            let mut control = InverseDynamics::with_settings(model, robot.feet(), settings);
            let home = robot.profile.home(model).unwrap();
            let mut posture =
                PostureTask::new(model, home.as_slice()).feedback(Feedback::critical(3.0)).weight(1.0);
            let mut even = ForceRegularisation::new(&control);
            control.begin(&robot.state(), 1e-3);
            control.add_task(&robot.state(), 0, &mut posture);
            control.add_task(&robot.state(), 0, &mut even);
            let solution = match control.solve() {
                Ok(solution) => solution.clone(),
                Err(error) => {
                    // a random state may require forces that friction cannot provide
                    assert!(matches!(error, InverseDynamicsError::Infeasible(_)), "{name}: {error}");
                    continue;
                }
            };
            let tau = newton_euler(&robot, &control);
            let scale = 1.0 + solution.torque.amax().max(solution.forces.amax());
            for (row, tau) in tau.iter().enumerate() {
                let expected = match row.checked_sub(model.nv() - model.joint_count()) {
                    None => 0.0,
                    Some(joint) => solution.torque[joint],
                };
                assert!((tau - expected).abs() < 1e-7 * scale, "{name}, row {row}: {tau} {expected}");
            }
        }
    }
}

#[test]
fn solutions_are_optimal_and_within_the_friction_cone() {
    let mut random = Random(12);
    let mut slipping = 0;
    for case in 0..40 {
        let mut robot = Robot::new("humanoid");
        robot.v.iter_mut().for_each(|v| *v = random.within(0.02));
        robot.update();
        let model = &robot.model;
        let mut contacts = robot.feet();
        contacts.iter_mut().for_each(|contact| contact.friction = 0.3);
        let mut control = InverseDynamics::new(model, contacts);
        let mut centre = CentreOfMassTask::new(model).feedback(Feedback::critical(5.0));
        let aim = Vector3::new(random.within(0.2), random.within(0.2), random.within(0.1));
        centre.set_target(robot.kinematics.centre_of_mass(model).position + aim);
        let mut posture =
            PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(0.1);
        let mut even = ForceRegularisation::new(&control);
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut centre);
        control.add_task(&robot.state(), 0, &mut posture);
        control.add_task(&robot.state(), 0, &mut even);
        let solution = control.solve().unwrap().clone();
        assert!(solution.slack.is_none(), "case {case}");
        let mut solver = motorium_qp::ActiveSetSolver::new(
            structure(control.problem()),
            motorium_qp::ActiveSetSettings::default(),
        );
        use motorium_qp::QpSolver;
        solver.update(control.problem()).unwrap();
        let residual = KktResidual::from_solution(control.problem(), solver.solve().unwrap());
        assert!(residual.worst() < 1e-6, "case {case}: {residual:?}");
        for force in solution.forces.as_slice().chunks_exact(3) {
            let tangential = force[0].hypot(force[1]);
            assert!(force[2] >= -1e-9 && tangential <= 0.3 * force[2] + 1e-9, "case {case}: {force:?}");
        }
        control.visit_active(&mut |name| {
            slipping += u32::from(matches!(name, ConstraintName::Friction { .. }));
        });
    }
    assert!(slipping > 20, "{slipping} active faces of pyramids");
}

fn structure(problem: &motorium_qp::Problem) -> motorium_qp::Structure {
    use motorium_qp::{Sides, Structure};
    Structure::new(problem.gradient.len())
        .equalities(problem.equality_value.len())
        .rows(problem.row_lower.len(), Sides::Both)
        .bounds(Sides::Both)
}

#[test]
fn an_inactive_contact_carries_no_force() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let mut control = InverseDynamics::new(model, robot.feet());
    control.set_active(1, false);
    let mut posture = PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap();
    assert!(solution.slack.is_none());
    assert_eq!(control.wrench(1).linear, Vector3::zeros());
    assert!(control.wrench(0).linear.z > 100.0);
    // and back
    control.set_active(1, true);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    control.solve().unwrap();
    assert!(control.wrench(1).linear.z > 10.0);
    control.set_max_force(1, 1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    control.solve().unwrap();
    assert!(control.wrench(1).linear.z <= 4.0 + 1e-6);
}

#[test]
fn joint_driven_to_its_limit_stays_within_its_limits() {
    let mut random = Random(13);
    let limits = JointAccelerationLimits { braking: 15.0, max_acceleration: 80.0, ..Default::default() };
    for _ in 0..200 {
        let range = (-1.0 - random.next(), 0.5 + random.next());
        let (dt, speed) = ([1e-3, 5e-3][(random.next() * 2.0) as usize], 1.0 + 2.0 * random.next());
        let (mut q, mut v) = (random.within(0.4), random.within(1.0));
        let mut push = 80.0;
        for step in 0..4000 {
            if step % 700 == 0 {
                push = -push;
            }
            let (lower, upper) = limits.bounds(q, v, range, speed, dt);
            assert!(lower <= upper);
            let a = f64::clamp(push * random.next(), lower, upper);
            q += v * dt + 0.5 * a * dt * dt;
            v += a * dt;
            assert!(q >= range.0 - 1e-9 && q <= range.1 + 1e-9, "{q} of {range:?}");
            assert!(v.abs() <= speed + 1e-9, "{v} of {speed}");
            assert!(a.abs() <= limits.max_acceleration + 1e-9, "{a}");
        }
    }
}

#[test]
fn joints_keep_their_own_acceleration_limits() {
    let robot = Robot::new("panda");
    let model = &robot.model;
    let most = DVector::from_vec(vec![15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0, f64::INFINITY]);
    let far: Vec<f64> = robot.q.iter().map(|q| q + 0.5).collect();
    let mut posture = PostureTask::new(model, &far).feedback(Feedback::critical(20.0)).weight(1.0);
    let mut solve = |control: InverseDynamics| {
        let mut control = control;
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut posture);
        control.solve().unwrap().acceleration.clone()
    };
    let limited = solve(InverseDynamics::new(model, Vec::new()).limit_accelerations(most.clone()));
    let free = solve(InverseDynamics::new(model, Vec::new()));
    for joint in 0..7 {
        assert!(limited[joint].abs() <= most[joint] + 1e-6, "joint {joint}: {limited}");
    }
    let exceeds = (0..7).filter(|joint| free[*joint].abs() > 2.0 * most[*joint]).count();
    assert!(exceeds > 3 && limited[7].abs() > 20.0, "{limited} {free}");
}

#[test]
fn saturated_torques_hold_and_are_named() {
    let robot = Robot::new("panda");
    let model = &robot.model;
    let settings = InverseDynamicsSettings { torque_fraction: 0.5, ..Default::default() };
    let mut control = InverseDynamics::with_settings(model, Vec::new(), settings);
    let target: Vec<f64> = robot.q.iter().map(|q| q + 0.3).collect();
    let mut posture = PostureTask::new(model, &target).feedback(Feedback::critical(40.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap().clone();
    let mut named = Vec::new();
    control.visit_active(&mut |name| named.push(name));
    let limit = model.effort_limit() * 0.5;
    let at_limit =
        solution.torque.iter().zip(limit.iter()).filter(|(t, l)| (t.abs() - **l).abs() < 1e-6).count();
    assert!(at_limit > 0, "{}", solution.torque);
    assert!(solution.torque.iter().zip(limit.iter()).all(|(t, l)| t.abs() <= *l + 1e-9));
    let torques = named.iter().filter(|name| matches!(name, ConstraintName::Torque { .. })).count();
    assert_eq!(torques, at_limit, "{named:?}");
    assert_eq!(solution.active, named.len());
}

#[test]
fn lower_levels_use_only_the_freedom_left_by_higher_ones() {
    let robot = Robot::new("humanoid");
    let (model, state) = (&robot.model, robot.state());
    let hand = model.frame("left_palm").unwrap();
    let mut target = robot.kinematics.pose(model, hand);
    target.translation.x += 0.1;
    let mut reach = CartesianTask::new(model, hand)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(5.0));
    reach.set_target(target);
    let against: Vec<f64> = robot.q[7..].iter().map(|q| q - 0.4).collect();
    let solve =
        |levels: &[usize], tasks: &mut [&mut dyn motorium_control::inverse_dynamics::AccelerationTask]| {
            let settings = InverseDynamicsSettings { damping: 1e-6, ..Default::default() };
            let mut control = InverseDynamics::with_settings(model, robot.feet(), settings).levels(levels);
            control.begin(&state, 1e-3);
            for (level, task) in tasks.iter_mut().enumerate() {
                control.add_task(&state, level.min(levels.len() - 1), *task);
            }
            let solution = control.solve().unwrap().clone();
            let residuals: Vec<f64> = tasks.iter().map(|task| control.residual(&**task)).collect();
            (solution, residuals, newton_euler(&robot, &control))
        };
    let mut posture = PostureTask::new(model, &against).feedback(Feedback::critical(5.0)).weight(1.0);
    let (_, alone, _) = solve(&[6], &mut [&mut reach]);
    let (both, stacked, tau) = solve(&[6, posture_rows(model)], &mut [&mut reach, &mut posture]);
    let (_, summed, _) = solve(&[6 + posture_rows(model)], &mut [&mut reach, &mut posture]);
    assert!(alone[0] < 1e-3, "{alone:?}");
    assert!((stacked[0] - alone[0]).abs() < 1e-6, "the hand is not disturbed: {stacked:?} {alone:?}");
    assert!(summed[0] > 0.1, "a weighted sum must disturb the hand: {summed:?}");
    // contacts, torques and equations of motion also hold for lower levels
    for (row, tau) in tau.iter().enumerate() {
        let expected = row.checked_sub(6).map_or(0.0, |joint| both.torque[joint]);
        assert!((tau - expected).abs() < 1e-5, "row {row}: {tau} {expected}");
    }
    for force in both.forces.as_slice().chunks_exact(3) {
        assert!(force[2] >= -1e-6 && force[0].hypot(force[1]) <= 0.6 * force[2] + 1e-6, "{force:?}");
    }
}

fn posture_rows(model: &motorium_robots::Model) -> usize {
    model.joint_count()
}

/// A state in which the legs spread faster than their joints can brake, so the feet cannot stay at rest.
fn torn() -> Robot {
    let mut robot = Robot::new("humanoid");
    for (joint, v) in [("left_hip_roll", 1.0), ("right_hip_roll", -1.0)] {
        let joint = robot.model.joint_index(joint).unwrap();
        robot.v[6 + joint] = v;
    }
    robot.update();
    robot
}

/// Settings whose joints accelerate very slowly.
fn sluggish(relaxation: Option<f64>) -> InverseDynamicsSettings {
    let joints = JointAccelerationLimits { braking: 0.1, max_acceleration: 0.5, ..Default::default() };
    InverseDynamicsSettings { relaxation, joints, ..Default::default() }
}

#[test]
fn conflicting_constraints_are_named_without_relaxation() {
    let robot = torn();
    let mut control = InverseDynamics::with_settings(&robot.model, robot.feet(), sluggish(None));
    control.begin(&robot.state(), 1e-3);
    let Err(InverseDynamicsError::Infeasible(conflict)) = control.solve() else {
        panic!("expected no solution")
    };
    let contacts: Vec<_> = control.contacts().cloned().collect();
    let words = conflict.describe(&robot.model, &contacts);
    assert!(conflict.names().count() >= 2, "{words}");
    assert!(words.contains("at rest") && words.contains("limit of joint"), "{words}");
}

#[test]
fn relaxed_tick_reports_its_violation_and_keeps_physics() {
    let robot = torn();
    let mut control = InverseDynamics::with_settings(&robot.model, robot.feet(), sluggish(Some(100.0)));
    let mut posture =
        PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap().clone();
    let slack = solution.slack.expect("a constraint must be violated");
    assert!(slack.contact.max(slack.joint) > 1.0, "{slack:?}");
    assert!(slack.conflict.names().count() >= 2);
    let tau = newton_euler(&robot, &control);
    for (row, tau) in tau.iter().enumerate() {
        let expected = row.checked_sub(6).map_or(0.0, |joint| solution.torque[joint]);
        assert!((tau - expected).abs() < 1e-5, "row {row}: {tau} {expected}");
    }
    let limit = robot.model.effort_limit();
    assert!(solution.torque.iter().zip(limit.iter()).all(|(tau, limit)| tau.abs() <= limit + 1e-9));
    // at rest nothing is relaxed
    let calm = Robot::new("humanoid");
    control.begin(&calm.state(), 1e-3);
    control.add_task(&calm.state(), 0, &mut posture);
    assert!(control.solve().unwrap().slack.is_none());
}

#[test]
fn a_tick_allocates_nothing() {
    let (robot, torn) = (Robot::new("humanoid"), torn());
    let model = &robot.model;
    let hand = model.frame("left_palm").unwrap();
    let settings = sluggish(Some(100.0));
    let mut control =
        InverseDynamics::with_settings(model, robot.feet(), settings).levels(&[3, 6, model.joint_count()]);
    let mut centre = CentreOfMassTask::new(model).feedback(Feedback::critical(5.0));
    let mut reach = CartesianTask::new(model, hand)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(5.0));
    let mut posture = PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    let (mut relaxed, mut undecided) = (0, 0);
    let allocations = motorium::testing::allocations(|| {
        for robot in [&robot, &torn, &robot] {
            control.begin(&robot.state(), 1e-3);
            control.add_task(&robot.state(), 0, &mut centre);
            control.add_task(&robot.state(), 1, &mut reach);
            control.add_task(&robot.state(), 2, &mut posture);
            let solution = control.solve().unwrap();
            relaxed += u32::from(solution.slack.is_some());
            undecided += solution.undecided;
        }
    });
    assert_eq!(allocations, 0);
    assert!(relaxed >= 1);
    println!("{undecided} levels undecided");
}

#[test]
fn joint_damping_is_compensated_by_the_configured_share() {
    let mut robot = Robot::new("iiwa14");
    robot.v.fill(0.7);
    robot.update();
    let torque = |share: f64| {
        let settings = InverseDynamicsSettings { joint_damping: share, ..Default::default() };
        let mut control = InverseDynamics::with_settings(&robot.model, Vec::new(), settings);
        let mut posture =
            PostureTask::new(&robot.model, &robot.q).feedback(Feedback { kp: 0.0, kd: 0.0 }).weight(1.0);
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut posture);
        control.solve().unwrap().torque.clone()
    };
    let (none, half) = (torque(0.0), torque(0.5));
    for joint in 0..robot.model.joint_count() {
        let damping = robot.model.joint(joint).dynamics.damping;
        assert!(damping > 0.0);
        assert!((half[joint] - none[joint] - 0.5 * damping * 0.7).abs() < 1e-6, "{none} {half}");
    }
}

#[test]
fn free_fall_without_contacts_needs_no_torque() {
    let robot = Robot::new("quadruped");
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    let mut posture =
        PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap();
    let mut expected = DVector::zeros(robot.model.nv());
    expected[2] = -9.81;
    assert!((&solution.acceleration - &expected).amax() < 1e-4, "{}", solution.acceleration);
    assert!(solution.torque.amax() < 1e-4);
}
