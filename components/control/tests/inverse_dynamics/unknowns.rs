//! Forces-only and accelerations-only problems, compared with analytic results and with full inverse
//! dynamics.

use motorium_control::inverse_dynamics::{
    AccelerationTask, ConstraintName, ContactShape, DynamicsRows, FrictionModel, InverseDynamics,
    InverseDynamicsError, InverseDynamicsSettings, Unknowns,
};
use motorium_control::tasks::{CartesianSettings, CartesianTask, CentreOfMassTask, PostureTask};
use motorium_control::tasks::{ContactWrench, Feedback};
use motorium_robots::{Dynamics, Reference, Twist};
use nalgebra::{DMatrix, DVector, Matrix6xX, Vector3};

use crate::robots::{Random, Robot};

fn settings(unknowns: Unknowns) -> InverseDynamicsSettings {
    InverseDynamicsSettings { unknowns, ..InverseDynamicsSettings::default() }
}

fn on_its_feet(robot: &Robot, unknowns: Unknowns) -> InverseDynamics {
    InverseDynamics::with_settings(&robot.model, robot.feet(), settings(unknowns))
}

/// Inverse dynamics with capacity for six rows of constraint tasks.
fn with_equalities(robot: &Robot) -> InverseDynamics {
    let rows = DynamicsRows { constrained: 6, limits: 0 };
    InverseDynamics::with_room(&robot.model, robot.feet(), settings(Unknowns::Forces), rows)
}

/// Jacobian of the contact points in world axes, from the kinematics: 3 rows per point.
fn point_jacobian(robot: &Robot) -> DMatrix<f64> {
    let model = &robot.model;
    let mut rows = DMatrix::zeros(3 * robot.feet().len(), model.nv());
    for (foot, contact) in robot.feet().iter().enumerate() {
        let radius = match contact.shape {
            ContactShape::Ball { radius } => radius,
            ContactShape::Point => 0.0,
            ContactShape::Sole { .. } => panic!("a foot with a sole"),
        };
        let mut jacobian = Matrix6xX::zeros(model.nv());
        robot.kinematics.jacobian(model, contact.frame, Reference::LocalWorldAligned, &mut jacobian);
        for (column, motion) in jacobian.column_iter().enumerate() {
            let turn = motion.fixed_rows::<3>(3).into_owned();
            let moved = motion.fixed_rows::<3>(0) + turn.cross(&Vector3::new(0.0, 0.0, -radius));
            rows.fixed_view_mut::<3, 1>(3 * foot, column).copy_from(&moved);
        }
    }
    rows
}

fn bias(robot: &Robot) -> DVector<f64> {
    let mut bias = vec![0.0; robot.model.nv()];
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    Dynamics::new(&robot.model).bias(&robot.model, &robot.q, &robot.v, gravity, &mut bias);
    DVector::from_vec(bias)
}

/// A task that keeps the base in place.
fn base_at_rest(robot: &Robot) -> CartesianTask {
    let frame = robot.model.frame("base").unwrap();
    let mut base = CartesianTask::new(&robot.model, frame)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(10.0));
    base.set_target(robot.kinematics.pose(&robot.model, frame));
    base
}

#[test]
fn forces_at_rest_are_the_minimum_for_the_weight() {
    let robot = Robot::new("quadruped");
    let mut control = with_equalities(&robot);
    let mut base = base_at_rest(&robot);
    control.begin(&robot.state(), 1e-3);
    control.constrain(&robot.state(), &mut base);
    let solution = control.solve().unwrap();
    assert!(solution.slack.is_none());
    assert!(solution.acceleration.amax() < 1e-9, "{}", solution.acceleration);
    // the least-norm solution of J_u' f = h_u, and the torques h_a - J_a' f
    let (jacobian, bias) = (point_jacobian(&robot), bias(&robot));
    let (of_base, of_joints) = (jacobian.columns(0, 6).transpose(), jacobian.columns(6, 12).transpose());
    let least = of_base.clone().svd(true, true).solve(&bias.rows(0, 6), 1e-12).unwrap();
    assert!((&solution.forces - &least).amax() < 1e-6, "{} {least}", solution.forces);
    let torque = bias.rows(6, 12) - of_joints * &least;
    assert!((&solution.torque - torque).amax() < 1e-6);
}

#[test]
fn forces_only_and_inverse_dynamics_agree_at_rest() {
    for name in ["quadruped", "humanoid"] {
        let robot = Robot::new(name);
        let model = &robot.model;
        let solve = |unknowns| {
            let mut control = on_its_feet(&robot, unknowns);
            let mut balance = CentreOfMassTask::new(model).feedback(Feedback::critical(5.0));
            balance.set_target(robot.kinematics.centre_of_mass(model).position);
            let mut body = CartesianTask::new(model, model.frame(body(name)).unwrap())
                .with(CartesianSettings::geometric())
                .feedback(Feedback::critical(5.0));
            body.set_target(robot.kinematics.pose(model, body.frame()));
            let mut posture = PostureTask::new(model, model.joints_of_q(&robot.q))
                .feedback(Feedback::critical(5.0))
                .weight(1.0);
            control.begin(&robot.state(), 1e-3);
            control.add_task(&robot.state(), 0, &mut balance);
            control.add_task(&robot.state(), 0, &mut body);
            if unknowns == Unknowns::AccelerationsAndForces {
                control.add_task(&robot.state(), 0, &mut posture);
            }
            control.solve().unwrap().clone()
        };
        let (both, forces) = (solve(Unknowns::AccelerationsAndForces), solve(Unknowns::Forces));
        assert!(both.acceleration.amax() < 1e-2 && forces.acceleration.amax() < 1e-2);
        assert!((&both.forces - &forces.forces).amax() < 0.1, "{name}: {} {}", both.forces, forces.forces);
        assert!((&both.torque - &forces.torque).amax() < 0.05, "{name}: {} {}", both.torque, forces.torque);
    }
}

fn body(name: &str) -> &'static str {
    if name == "quadruped" { "base" } else { "pelvis" }
}

#[test]
fn forces_sum_to_the_rate_of_linear_momentum() {
    let robot = Robot::new("quadruped");
    let model = &robot.model;
    let gain = 6.0;
    for offset in [[0.01, 0.0, 0.0], [0.0, -0.01, 0.005], [0.005, 0.005, -0.01]] {
        let mut control = with_equalities(&robot);
        let mut balance = CentreOfMassTask::new(model).feedback(Feedback::critical(gain));
        balance.set_target(robot.kinematics.centre_of_mass(model).position + Vector3::from(offset));
        control.begin(&robot.state(), 1e-3);
        control.constrain(&robot.state(), &mut balance);
        let solution = control.solve().unwrap();
        let total: Vector3<f64> =
            (0..4).map(|foot| Vector3::from_column_slice(&solution.forces.as_slice()[3 * foot..][..3])).sum();
        let expected = model.mass() * (Vector3::from(offset) * gain * gain + Vector3::new(0.0, 0.0, 9.81));
        assert!((total - expected).norm() < 1e-6, "{total} {expected}");
        // the equation of motion of all rows, by other algorithms
        let jacobian = point_jacobian(&robot);
        let mut tau = vec![0.0; model.nv()];
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        Dynamics::new(model).rnea(
            model,
            &robot.q,
            &robot.v,
            solution.acceleration.as_slice(),
            gravity,
            &mut tau,
        );
        let mut left = DVector::from_vec(tau) - jacobian.transpose() * &solution.forces;
        left.rows_mut(6, 12).zip_apply(&solution.torque, |left, torque| *left -= torque);
        assert!(left.amax() < 1e-6, "{left}");
    }
}

#[test]
fn forces_keep_friction_and_torque_limits_under_any_task() {
    let robot = Robot::new("quadruped");
    let model = &robot.model;
    for friction_model in [FrictionModel::Pyramid, FrictionModel::Cone] {
        let given = InverseDynamicsSettings { friction_model, ..settings(Unknowns::Forces) };
        let mut control = InverseDynamics::with_settings(model, robot.feet(), given);
        let mut balance = CentreOfMassTask::new(model).feedback(Feedback::critical(10.0));
        balance.set_target(robot.kinematics.centre_of_mass(model).position + Vector3::new(1.0, 0.0, 0.0));
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut balance);
        let solution = control.solve().unwrap().clone();
        let mut at_friction = 0;
        control.visit_active(&mut |name| {
            at_friction += usize::from(matches!(name, ConstraintName::Friction { .. }))
        });
        assert!(at_friction > 0, "{friction_model:?}");
        let friction = robot.feet()[0].friction;
        for force in solution.forces.as_slice().as_chunks::<3>().0 {
            let sideways = force[0].hypot(force[1]);
            assert!(force[2] >= -1e-6 && sideways <= friction * force[2] + 1e-4, "{force:?}");
        }
        for (torque, limit) in solution.torque.iter().zip(model.effort_limit().iter()) {
            assert!(torque.abs() <= limit + 1e-6);
        }
    }
}

#[test]
fn an_equality_against_friction_is_relaxed_or_named() {
    let robot = Robot::new("quadruped");
    let model = &robot.model;
    let mut far = CentreOfMassTask::new(model).feedback(Feedback::critical(10.0));
    far.set_target(robot.kinematics.centre_of_mass(model).position + Vector3::new(1.0, 0.0, 0.0));
    let rows = DynamicsRows { constrained: far.rows(), limits: 0 };
    for relaxation in [Some(100.0), None] {
        let given = InverseDynamicsSettings { relaxation, ..settings(Unknowns::Forces) };
        let mut control = InverseDynamics::with_room(model, robot.feet(), given, rows);
        control.begin(&robot.state(), 1e-3);
        control.constrain(&robot.state(), &mut far);
        match (relaxation, control.solve()) {
            (Some(_), Ok(solution)) => assert!(solution.slack.unwrap().task > 1.0, "{:?}", solution.slack),
            (None, Err(InverseDynamicsError::Infeasible(conflict))) => {
                let words = conflict.describe(model, &robot.feet());
                assert!(words.contains("tasks that are constraints"), "{words}");
            }
            (_, found) => panic!("{found:?}"),
        }
    }
}

#[test]
fn lifted_foot_has_no_force_in_a_forces_only_problem() {
    let robot = Robot::new("quadruped");
    let mut control = on_its_feet(&robot, Unknowns::Forces);
    control.set_active(1, false);
    let mut base = base_at_rest(&robot);
    let mut push = ContactWrench::new(&control, 0).weights(1.0, 0.0);
    push.set_target(Twist { linear: Vector3::new(0.0, 0.0, 5.0), angular: Vector3::zeros() });
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut base);
    control.add_task(&robot.state(), 0, &mut push);
    let forces = control.solve().unwrap().forces.clone();
    assert!(forces.rows(3, 3).amax() == 0.0, "{forces}");
    assert!(forces.rows(6, 6).amax() > 1.0, "{forces}");
}

#[test]
fn both_formulations_agree_on_a_fixed_base() {
    let (mut random, mut compared) = (Random(311), 0);
    for _ in 0..10 {
        let robot = Robot::new("panda").moved(&mut random);
        let model = &robot.model;
        let hand = model.frame("panda_hand_tcp").unwrap();
        for below in [0, 1] {
            let solve = |unknowns| {
                let mut control = InverseDynamics::with_settings(model, Vec::new(), settings(unknowns))
                    .levels(&[6, model.nv()][..1 + below]);
                let mut reach = CartesianTask::new(model, hand)
                    .with(CartesianSettings::geometric())
                    .feedback(Feedback::critical(5.0));
                let mut target = robot.kinematics.pose(model, hand);
                target.translation.vector += Vector3::new(0.02, -0.03, 0.01);
                reach.set_target(target);
                let home = robot.profile.home(model).unwrap();
                let mut posture =
                    PostureTask::new(model, home.as_slice()).feedback(Feedback::critical(3.0)).weight(0.1);
                control.begin(&robot.state(), 1e-3);
                control.add_task(&robot.state(), 0, &mut reach);
                control.add_task(&robot.state(), below, &mut posture);
                control.solve().unwrap().clone()
            };
            let (both, alone) = (solve(Unknowns::AccelerationsAndForces), solve(Unknowns::Accelerations));
            let limits = model.effort_limit();
            if both.torque.iter().zip(limits.iter()).any(|(torque, limit)| torque.abs() > limit - 1e-6) {
                continue;
            }
            compared += 1;
            let difference = (&both.acceleration - &alone.acceleration).amax();
            assert!(difference < 1e-5 * both.acceleration.amax().max(1.0), "{difference}");
            assert!((&both.torque - &alone.torque).amax() < 1e-5 * both.torque.amax());
            // torques computed from the model
            let mut tau = vec![0.0; model.nv()];
            let gravity = Vector3::new(0.0, 0.0, -9.81);
            Dynamics::new(model).rnea(
                model,
                &robot.q,
                &robot.v,
                alone.acceleration.as_slice(),
                gravity,
                &mut tau,
            );
            for ((torque, expected), limit) in alone.torque.iter().zip(&tau).zip(limits.iter()) {
                assert!((torque - expected.clamp(-limit, *limit)).abs() < 1e-6, "{torque} {expected}");
            }
        }
    }
    // the other cases require more than a drive can provide
    assert!(compared > 5, "{compared} of 20");
}

#[test]
fn accelerations_keep_feet_at_rest_and_yield_their_forces() {
    let mut random = Random(313);
    let mut robot = Robot::new("quadruped");
    robot.v.iter_mut().for_each(|v| *v = random.within(0.05));
    robot.update();
    let model = &robot.model;
    let solve = |unknowns| {
        let mut control = on_its_feet(&robot, unknowns);
        let mut base = base_at_rest(&robot);
        control.begin(&robot.state(), 1e-3);
        control.add_task(&robot.state(), 0, &mut base);
        control.solve().unwrap().clone()
    };
    let (both, alone) = (solve(Unknowns::AccelerationsAndForces), solve(Unknowns::Accelerations));
    assert!(
        (&both.acceleration - &alone.acceleration).amax() < 1e-2,
        "{} {}",
        both.acceleration,
        alone.acceleration
    );
    assert!((&both.forces - &alone.forces).amax() < 0.1, "{} {}", both.forces, alone.forces);
    // the equation of motion of the base holds with unilateral forces
    let mut tau = vec![0.0; model.nv()];
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    Dynamics::new(model).rnea(model, &robot.q, &robot.v, alone.acceleration.as_slice(), gravity, &mut tau);
    let mut left = DVector::from_vec(tau) - point_jacobian(&robot).transpose() * &alone.forces;
    left.rows_mut(6, 12).zip_apply(&alone.torque, |left, torque| *left -= torque);
    assert!(left.amax() < 1e-2, "{left}");
    assert!(alone.forces.iter().skip(2).step_by(3).all(|force| *force >= -1e-9));
}

#[test]
fn accelerations_alone_keep_the_limits_of_the_joints() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    robot.q[0] = model.upper()[0] - 0.01;
    robot.v[0] = 0.3;
    robot.update();
    let mut control = InverseDynamics::with_settings(&model, Vec::new(), settings(Unknowns::Accelerations));
    let beyond = vec![10.0; model.nv()];
    let mut posture = PostureTask::new(&model, &beyond).feedback(Feedback::critical(10.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    // 0.3^2 / (2 0.01) = 4.5 rad/s2, less than the braking limit of 20 rad/s2
    let limits = control.settings().joints;
    let (_, most) =
        limits.bounds(robot.q[0], 0.3, (model.lower()[0], model.upper()[0]), model.velocity_limit()[0], 1e-3);
    let a = control.solve().unwrap().acceleration[0];
    assert!((a - most).abs() < 1e-6, "{a} {most}");
}
