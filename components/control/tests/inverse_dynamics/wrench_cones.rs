//! Limits of the total wrench of a sole, and friction cones below the first of several levels.

use motorium_control::inverse_dynamics::{
    Contact, ContactShape, FrictionModel, InverseDynamics, InverseDynamicsSettings, WrenchCone,
};
use motorium_control::tasks::{CartesianSettings, CartesianTask, CentreOfMassTask, PostureTask};
use motorium_control::tasks::{ContactWrench, Feedback};
use motorium_qp::{ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, Structure};
use motorium_robots::Twist;
use nalgebra::{Matrix3, Vector3};

use crate::robots::{Random, Robot};

/// Returns `true` if forces at the corners of the rectangle, within their friction pyramids, can sum to this
/// wrench.
fn corners_can(cone: &WrenchCone, wrench: &[f64; 6]) -> bool {
    let structure = Structure::new(12).equalities(6).rows(16, Sides::Upper);
    let mut structure = structure;
    for corner in 0..4 {
        structure = structure.bound(3 * corner + 2, Sides::Lower);
    }
    let mut problem = Problem::new(&structure);
    problem.hessian.fill_with_identity();
    let mu = cone.friction / 2.0_f64.sqrt();
    for corner in 0..4 {
        let x = [0.5, 0.5, -0.5, -0.5][corner] * cone.sides[0];
        let y = [0.5, -0.5, -0.5, 0.5][corner] * cone.sides[1];
        let turn: Matrix3<f64> = Vector3::new(x, y, 0.0).cross_matrix();
        problem.equality_matrix.fixed_view_mut::<3, 3>(0, 3 * corner).fill_with_identity();
        problem.equality_matrix.fixed_view_mut::<3, 3>(3, 3 * corner).copy_from(&turn);
        for (face, (axis, sign)) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].into_iter().enumerate() {
            problem.row_matrix[(4 * corner + face, 3 * corner + axis)] = sign;
            problem.row_matrix[(4 * corner + face, 3 * corner + 2)] = -mu;
        }
        problem.lower[3 * corner + 2] = 0.0;
    }
    problem.row_upper.fill(0.0);
    problem.equality_value.copy_from_slice(wrench);
    let mut solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
    solver.update(&problem).unwrap();
    solver.solve().is_ok()
}

#[test]
fn a_wrench_cone_is_spanned_by_the_forces_at_its_corners() {
    let mut random = Random(51);
    let (mut inside, mut outside) = (0, 0);
    for _ in 0..4000 {
        let cone = WrenchCone {
            sides: [0.05 + 0.3 * random.next(), 0.05 + 0.3 * random.next()],
            friction: 0.1 + random.next(),
            ..WrenchCone::default()
        };
        let load = 50.0 * random.next();
        let wrench = [
            random.within(0.5 * load),
            random.within(0.5 * load),
            load,
            random.within(0.5 * cone.sides[1] * load),
            random.within(0.5 * cone.sides[0] * load),
            random.within(0.15 * load),
        ];
        let excess = cone.excess(&wrench);
        if excess.abs() < 1e-6 * (1.0 + load) {
            continue;
        }
        assert_eq!(corners_can(&cone, &wrench), excess < 0.0, "{cone:?} {wrench:?} {excess}");
        *if excess < 0.0 { &mut inside } else { &mut outside } += 1;
    }
    assert!(inside > 200 && outside > 200, "{inside} {outside}");
}

/// Force and torque of a contact of the humanoid in the axes of its sole.
fn in_sole(robot: &Robot, control: &InverseDynamics, contact: usize) -> [f64; 6] {
    let frame = control.contacts().nth(contact).unwrap().frame;
    let turn = robot.kinematics.pose(&robot.model, frame).rotation.inverse();
    let wrench = control.wrench(contact);
    let (force, torque) = (turn * wrench.linear, turn * wrench.angular);
    [force.x, force.y, force.z, torque.x, torque.y, torque.z]
}

#[test]
fn feet_stay_within_wrench_cones_under_any_task() {
    let mut random = Random(52);
    let mut tight = 0;
    for _ in 0..40 {
        let mut robot = Robot::new("humanoid");
        robot.v.iter_mut().for_each(|v| *v = random.within(0.1));
        robot.update();
        let model = &robot.model;
        let weight = model.mass() * 9.81;
        let cone = WrenchCone {
            sides: [0.08, 0.05],
            friction: 0.3,
            min_force: 0.3 * weight,
            max_force: 0.8 * weight,
            max_yaw: 1.0,
        };
        let solve = |cone: Option<WrenchCone>, push: Vector3<f64>| {
            let mut feet = robot.feet();
            feet.iter_mut().for_each(|foot| foot.wrench = cone);
            let mut control = InverseDynamics::with_settings(model, feet, InverseDynamicsSettings::default());
            let mut lean = CentreOfMassTask::new(model).feedback(Feedback::critical(5.0));
            lean.set_target(robot.kinematics.centre_of_mass(model).position + push);
            let mut posture =
                PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(0.1);
            control.begin(&robot.state(), 1e-3);
            control.add_task(&robot.state(), 0, &mut lean);
            control.add_task(&robot.state(), 0, &mut posture);
            assert!(control.solve().unwrap().slack.is_none());
            control
        };
        let push = random.vector(0.2);
        let (limited, free) = (solve(Some(cone), push), solve(None, push));
        for foot in 0..2 {
            let excess = cone.excess(&in_sole(&robot, &limited, foot));
            assert!(excess < 1e-7 * weight, "{excess}");
            tight += usize::from(cone.excess(&in_sole(&robot, &free, foot)) > 1.0);
        }
    }
    assert!(tight > 20, "wrenches exceed their cones without limits: {tight} of 80");
}

#[test]
fn a_wrench_cone_of_a_lifted_or_other_foot_is_inactive() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let cone = WrenchCone { min_force: 100.0, ..WrenchCone::default() };
    let frame = model.frame("left_palm").unwrap();
    let mut point = Contact::new("palm", frame, ContactShape::Point);
    point.wrench = Some(cone);
    let mut feet = robot.feet();
    feet.iter_mut().for_each(|foot| foot.wrench = Some(cone));
    feet.push(point);
    let mut control = InverseDynamics::new(model, feet);
    assert!(control.contacts().last().unwrap().wrench.is_none());
    control.set_active(2, false);
    control.set_active(0, false);
    let mut posture = PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    assert!(control.solve().unwrap().slack.is_none());
    assert!(control.wrench(0).linear.norm() < 1e-9);
    assert!(control.wrench(1).linear.z > 100.0 - 1e-6);
}

/// A motion that requires more than the available friction.
const PUSH: Vector3<f64> = Vector3::new(0.25, 0.2, -0.01);

/// Solution of up to three levels: the centre of mass, a palm, the posture.
fn levels(
    robot: &Robot,
    friction_model: FrictionModel,
    friction: f64,
    count: usize,
    push: Vector3<f64>,
) -> (InverseDynamics, [f64; 2]) {
    let model = &robot.model;
    let mut feet = robot.feet();
    feet.iter_mut().for_each(|foot| foot.friction = friction);
    let settings = InverseDynamicsSettings { friction_model, ..InverseDynamicsSettings::default() };
    let sizes = [3, 6, model.joint_count()];
    let mut control = InverseDynamics::with_settings(model, feet, settings).levels(&sizes[..count]);
    let mut lean = CentreOfMassTask::new(model).feedback(Feedback::critical(5.0));
    let centre = robot.kinematics.centre_of_mass(model).position;
    lean.set_target(centre + push);
    let mut palm = CartesianTask::new(model, model.frame("left_palm").unwrap())
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(8.0));
    palm.set_target(robot.kinematics.pose(model, palm.frame()));
    let mut posture = PostureTask::new(model, &vec![0.1; model.joint_count()])
        .feedback(Feedback::critical(5.0))
        .weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut lean);
    if count > 1 {
        control.add_task(&robot.state(), 1, &mut palm);
    }
    if count > 2 {
        control.add_task(&robot.state(), 2, &mut posture);
    }
    let undecided = control.solve().unwrap().undecided;
    assert_eq!(undecided, 0);
    let residuals = [control.residual(&lean), control.residual(&palm)];
    (control, residuals)
}

#[test]
fn levels_within_friction_cones_keep_higher_levels() {
    let robot = Robot::new("humanoid");
    let friction = 0.35;
    let (_, [alone, _]) = levels(&robot, FrictionModel::Cone, friction, 1, PUSH);
    let (control, [with_others, palm]) = levels(&robot, FrictionModel::Cone, friction, 3, PUSH);
    assert!((alone - with_others).abs() < 1e-4 * (1.0 + alone), "{alone} {with_others}");
    assert!(palm < 1e-3, "the palm rests: {palm}");
    for force in control.solution().forces.as_slice().chunks_exact(3) {
        let beyond = force[0].hypot(force[1]) - friction * force[2];
        assert!(beyond < 1e-4, "{force:?}");
    }
    // inside its pyramids the robot cannot lean as fast
    let (_, [pyramid, _]) = levels(&robot, FrictionModel::Pyramid, friction, 3, PUSH);
    assert!(alone < pyramid - 1e-2, "{alone} {pyramid}");
}

#[test]
fn cones_and_pyramids_agree_where_friction_does_not_bind() {
    let robot = Robot::new("humanoid");
    let (cones, _) = levels(&robot, FrictionModel::Cone, 0.9, 3, Vector3::zeros());
    let (pyramids, _) = levels(&robot, FrictionModel::Pyramid, 0.9, 3, Vector3::zeros());
    let difference = &cones.solution().acceleration - &pyramids.solution().acceleration;
    assert!(difference.amax() < 1e-3, "{}", difference.amax());
}

#[test]
fn a_wrench_task_is_the_same_for_the_contacts_of_a_level() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let mut control = InverseDynamics::new(model, robot.feet()).levels(&[6, model.joint_count()]);
    let mut wrench = ContactWrench::new(&control, 1);
    let wanted = Vector3::new(0.0, 0.0, 0.6 * model.mass() * 9.81);
    wrench.set_target(Twist { linear: wanted, angular: Vector3::zeros() });
    let mut posture = PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut wrench);
    control.add_task(&robot.state(), 1, &mut posture);
    control.solve().unwrap();
    assert!((control.wrench(1).linear - wanted).norm() < 1e-2, "{:?}", control.wrench(1));
}
