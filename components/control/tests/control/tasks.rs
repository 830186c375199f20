//! Errors, Jacobians and costs of tasks, compared with finite differences and matrix products.

use crate::robot::{Panda, Random};
use approx::assert_abs_diff_eq;
use motorium_control::{
    DifferentialIk, RobotState,
    tasks::{
        CartesianSettings, CartesianTask, CentreOfMassSettings, CentreOfMassTask, PostureSettings,
        PostureTask, VelocityTask,
    },
};
use motorium_qp::{Problem, Sides, Structure};
use motorium_robots::{Kinematics, MimicMode, Model, PackagePath, Twist, lie::se3, parse_urdf};
use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion, Vector3, Vector6};

fn update(task: &mut dyn VelocityTask, model: &Model, q: &[f64]) {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    task.update(&RobotState { model, kinematics: &kinematics, q });
}

fn error_at(task: &CartesianTask, model: &Model, q: &[f64]) -> Vector6<f64> {
    let mut task = task.clone();
    update(&mut task, model, q);
    task.error()
}

fn assert_jacobian_matches(mut task: CartesianTask, model: &Model, q: &[f64]) {
    let h = 1e-6;
    update(&mut task, model, q);
    for joint in 0..model.nv() {
        let (mut ahead, mut behind) = (q.to_vec(), q.to_vec());
        ahead[joint] += h;
        behind[joint] -= h;
        let rate = (error_at(&task, model, &ahead) - error_at(&task, model, &behind)) / (2.0 * h);
        let column: Vector6<f64> = task.jacobian().fixed_columns::<1>(joint).into_owned();
        assert_abs_diff_eq!(-column, rate, epsilon = 1e-7);
    }
}

fn anywhere(random: &mut Random) -> Isometry3<f64> {
    let translation = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
    let rotation = Vector3::new(random.within(1.5), random.within(1.5), random.within(1.5));
    Isometry3::new(translation, rotation)
}

#[test]
fn the_cartesian_jacobian_is_the_derivative_of_the_error() {
    let panda = Panda::new();
    let mut random = Random(3);
    for _ in 0..20 {
        let q = panda.near_home(1.0, &mut random);
        let mut task = CartesianTask::new(&panda.model, panda.hand);
        // the derivative is undefined at half a turn
        let target = panda.hand_at(&q) * anywhere(&mut random);
        task.set_target(target);
        assert_jacobian_matches(task, &panda.model, &q);
    }
}

#[test]
fn the_cartesian_jacobian_handles_sliding_and_mimic_joints() {
    let urdf = r#"<robot name="lift">
        <link name="base"/>
        <link name="carriage"/><link name="arm"/><link name="follower"/><link name="tool"/>
        <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/>
            <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        <joint name="turn" type="continuous"><parent link="carriage"/><child link="arm"/>
            <origin xyz="0.1 0 0" rpy="0.2 0 0"/><axis xyz="0 1 0"/></joint>
        <joint name="follow" type="revolute"><parent link="arm"/><child link="follower"/>
            <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/>
            <mimic joint="turn" multiplier="-0.5" offset="0.1"/></joint>
        <joint name="tip" type="fixed"><parent link="follower"/><child link="tool"/><origin xyz="0.3 0 0.1"/></joint>
    </robot>"#;
    let model = parse_urdf(urdf, None, MimicMode::default(), &PackagePath::default()).unwrap().model;
    assert_eq!(model.nv(), 2);
    let mut task = CartesianTask::new(&model, model.frame("tool").unwrap());
    task.set_target(Isometry3::new(Vector3::new(0.3, 0.2, 0.1), Vector3::new(0.1, -0.4, 0.3)));
    assert_jacobian_matches(task, &model, &[0.3, 4.0]);
}

#[test]
fn the_velocity_of_the_target_is_the_derivative_of_the_error() {
    let panda = Panda::new();
    let mut random = Random(5);
    let h = 1e-6;
    for _ in 0..20 {
        let q = panda.near_home(1.0, &mut random);
        let target = panda.hand_at(&q) * anywhere(&mut random);
        let velocity = Twist { linear: Vector3::new(0.3, -0.2, 0.5), angular: Vector3::new(-0.4, 0.1, 0.7) };
        let moved = |time: f64| {
            let rotation = UnitQuaternion::from_scaled_axis(velocity.angular * time) * target.rotation;
            Isometry3::from_parts((target.translation.vector + velocity.linear * time).into(), rotation)
        };
        let error = |time: f64| se3::log(&panda.hand_at(&q).inv_mul(&moved(time)));
        let rate = (error(h) - error(-h)) / (2.0 * h);

        let mut task = CartesianTask::new(&panda.model, panda.hand);
        task.set_moving_target(target, velocity, Twist::zero());
        update(&mut task, &panda.model, &q);
        let feed_forward = task.desired() - task.error() * task.settings().gain;
        assert_abs_diff_eq!(feed_forward, rate, epsilon = 1e-7);
    }
}

#[test]
fn a_geometric_error_decays_along_a_straight_line() {
    let panda = Panda::new();
    let model = &panda.model;
    let offset = Isometry3::new(Vector3::new(0.05, 0.05, -0.05), Vector3::new(0.0, 0.0, 1.0));
    let start = panda.hand_at(panda.home.as_slice());
    let target = start * offset;
    let way = target.translation.vector - start.translation.vector;
    let run = |settings: CartesianSettings| {
        let mut task = CartesianTask::new(model, panda.hand).with(settings);
        task.set_target(target);
        let (mut ik, mut q) = (DifferentialIk::new(model), panda.home.as_slice().to_vec());
        let mut farthest = 0.0_f64;
        for _ in 0..1000 {
            let mut kinematics = Kinematics::new(model);
            kinematics.update(model, &q);
            let state = RobotState { model, kinematics: &kinematics, q: &q };
            ik.begin();
            ik.add_task(&state, 0, &mut task);
            let step: Vec<f64> = ik.solve().unwrap().iter().map(|v| v * 1e-3).collect();
            let moved = kinematics.pose(model, panda.hand).translation.vector - start.translation.vector;
            farthest = farthest.max(moved.cross(&way).norm() / way.norm());
            model.integrate(&q.clone(), &step, &mut q);
        }
        (farthest, task.position_error(), task.orientation_error())
    };
    // damping would bend both paths
    let run = |settings: CartesianSettings| run(CartesianSettings { damping: 0.0, ..settings });
    let (off, position, orientation) = run(CartesianSettings::geometric());
    assert!(position < 1e-4 && orientation < 1e-3, "{position} {orientation}");
    let (screw, ..) = run(CartesianSettings::default());
    assert!(off < 5e-4 && screw > 5e-3, "{off} m and {screw} m off the line");
}

#[test]
fn errors_are_reported_in_metres_and_radians() {
    let panda = Panda::new();
    let offset = Isometry3::new(Vector3::new(0.03, 0.0, -0.04), Vector3::new(0.0, 0.3, 0.0));
    let mut task = CartesianTask::new(&panda.model, panda.hand);
    task.set_target(panda.hand_at(panda.home.as_slice()) * offset);
    update(&mut task, &panda.model, panda.home.as_slice());
    assert_abs_diff_eq!(task.position_error(), 0.05, epsilon = 1e-12);
    assert_abs_diff_eq!(task.orientation_error(), 0.3, epsilon = 1e-12);
}

#[test]
fn fast_correction_is_slowed_in_its_direction() {
    let panda = Panda::new();
    let mut task = CartesianTask::new(&panda.model, panda.hand);
    let offset = Isometry3::new(Vector3::new(0.3, -0.1, 0.2), Vector3::new(0.5, 0.0, -1.0));
    task.set_target(panda.hand_at(panda.home.as_slice()) * offset);
    for (linear, angular) in
        [(0.25, f64::INFINITY), (f64::INFINITY, 0.5), (0.25, 0.5), (100.0, 100.0), (0.0, 1.0)]
    {
        let settings =
            CartesianSettings { max_linear_speed: linear, max_angular_speed: angular, ..Default::default() };
        task.set_settings(settings);
        update(&mut task, &panda.model, panda.home.as_slice());
        let desired = task.desired();
        let (l, a) = (desired.fixed_rows::<3>(0).norm(), desired.fixed_rows::<3>(3).norm());
        let fast = task.error() * settings.gain;
        let scale = desired.norm() / fast.norm();
        assert_abs_diff_eq!(desired, &(fast * scale), epsilon = 1e-12);
        assert!(l <= linear + 1e-12 && a <= angular + 1e-12, "{l} m/s, {a} rad/s");
        let at_limit = (l - linear).abs() < 1e-12 || (a - angular).abs() < 1e-12;
        assert!(at_limit || scale > 1.0 - 1e-12, "slowed without need: {l} m/s, {a} rad/s");
    }
}

/// Returns the Hessian (upper triangle mirrored) and the gradient that a task adds to an empty problem.
fn cost(task: &dyn VelocityTask, joints: usize) -> (DMatrix<f64>, DVector<f64>) {
    let mut problem = Problem::new(&Structure::new(joints).bounds(Sides::Both));
    task.add_to(&mut problem);
    problem.hessian.fill_lower_triangle_with_upper_triangle();
    (problem.hessian, problem.gradient)
}

#[test]
fn the_cartesian_cost_is_its_weighted_square() {
    let panda = Panda::new();
    let mut random = Random(7);
    let q = panda.near_home(0.5, &mut random);
    let settings = CartesianSettings { position_weight: 2.0, orientation_weight: 0.3, ..Default::default() };
    let mut task = CartesianTask::new(&panda.model, panda.hand).with(settings);
    task.set_target(panda.hand_at(panda.home.as_slice()));
    update(&mut task, &panda.model, &q);

    let w = DMatrix::from_diagonal(&DVector::from_column_slice(&[2.0, 2.0, 2.0, 0.3, 0.3, 0.3]));
    let a = &w * task.jacobian();
    let b = &w * task.desired();
    let damping = settings.damping * (&w * &w * task.error() * settings.gain).norm();
    let (hessian, gradient) = cost(&task, panda.model.nv());
    let identity = DMatrix::identity(panda.model.nv(), panda.model.nv());
    assert_abs_diff_eq!(hessian, a.tr_mul(&a) + identity * damping, epsilon = 1e-12);
    assert_abs_diff_eq!(gradient, -a.tr_mul(&b), epsilon = 1e-12);
}

#[test]
fn posture_cost_requests_exponential_decay_per_joint() {
    let panda = Panda::new();
    let mut random = Random(9);
    let q = panda.near_home(0.5, &mut random);
    let mut task = PostureTask::new(&panda.model, panda.home.as_slice())
        .with(PostureSettings { gain: 3.0, weight: 0.5 });
    task.set_share(2, 0.0);
    task.set_share(3, 2.0);
    update(&mut task, &panda.model, &q);
    let (hessian, gradient) = cost(&task, panda.model.nv());
    for joint in 0..panda.model.nv() {
        let curvature = [0.25, 0.0, 1.0][usize::from(joint == 2) + 2 * usize::from(joint == 3)];
        assert_abs_diff_eq!(hessian[(joint, joint)], curvature, epsilon = 1e-15);
        // the minimum of each joint's cost is the decay of its error
        let decay = 3.0 * (panda.home[joint] - q[joint]);
        assert_abs_diff_eq!(gradient[joint], -curvature * decay, epsilon = 1e-12);
    }
}

/// The centre of mass as the sum over all bodies.
fn centre_of_mass(model: &Model, q: &[f64]) -> Vector3<f64> {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for (index, body) in model.bodies().iter().enumerate() {
        let centre = kinematics.body_pose(index) * Point3::from(body.inertia.com);
        mass += body.inertia.mass;
        moment += centre.coords * body.inertia.mass;
    }
    moment / mass
}

#[test]
fn the_centre_of_mass_task_matches_the_sum_over_bodies() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut random = Random(13);
    let h = 1e-6;
    for _ in 0..20 {
        let q = panda.near_home(1.0, &mut random);
        let target = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
        let mut task = CentreOfMassTask::new(model);
        task.set_target(target);
        update(&mut task, model, &q);
        assert_abs_diff_eq!(task.error(), target - centre_of_mass(model, &q), epsilon = 1e-12);
        for joint in 0..model.nv() {
            let (mut ahead, mut behind) = (q.clone(), q.clone());
            ahead[joint] += h;
            behind[joint] -= h;
            let rate = (centre_of_mass(model, &ahead) - centre_of_mass(model, &behind)) / (2.0 * h);
            assert_abs_diff_eq!(task.jacobian().column(joint).into_owned(), rate, epsilon = 1e-8);
        }
    }
}

#[test]
fn the_cost_of_the_centre_of_mass_is_its_weighted_square() {
    let panda = Panda::new();
    let mut random = Random(17);
    let q = panda.near_home(0.5, &mut random);
    let velocity = Vector3::new(0.1, -0.2, 0.05);
    for max_speed in [f64::INFINITY, 0.3] {
        let settings = CentreOfMassSettings {
            gain: 4.0,
            weight: 2.0,
            shares: [1.0, 0.5, 0.0],
            max_speed,
            damping: 0.01,
        };
        let mut task = CentreOfMassTask::new(&panda.model).with(settings);
        task.set_moving_target(Vector3::new(0.3, 0.4, 0.2), velocity, Vector3::zeros());
        update(&mut task, &panda.model, &q);

        let error = Vector3::new(0.3, 0.4, 0.2) - centre_of_mass(&panda.model, &q);
        let correction = 4.0 * error * (max_speed / (4.0 * error.norm())).min(1.0);
        assert_abs_diff_eq!(task.desired(), correction + velocity, epsilon = 1e-12);
        let w = DMatrix::from_diagonal(&DVector::from_column_slice(&[2.0, 1.0, 0.0]));
        let a = &w * task.jacobian();
        let b = &w * (correction + velocity);
        let damping = 0.01 * (&w * &w * correction).norm();
        let (hessian, gradient) = cost(&task, panda.model.nv());
        let identity = DMatrix::identity(panda.model.nv(), panda.model.nv());
        assert_abs_diff_eq!(hessian, a.tr_mul(&a) + identity * damping, epsilon = 1e-12);
        assert_abs_diff_eq!(gradient, -a.tr_mul(&b), epsilon = 1e-12);
    }
}
