//! Pose weights per axis, compared with finite differences; free axes.

use motorium_control::{
    DifferentialIk, RobotState,
    tasks::{AxisShares, CartesianSettings, CartesianTask, PoseAxes, PostureTask, VelocityTask},
};
use motorium_robots::{FrameId, Kinematics, Model, Twist, load};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3, Vector6};

use crate::component::number;
use crate::graph::{Targets, controller, graph, run};
use crate::robot::{ClosedLoop, Panda, Random};

const ALL: [PoseAxes; 3] = [PoseAxes::Frame, PoseAxes::Target, PoseAxes::World];

fn update(task: &mut CartesianTask, model: &Model, q: &[f64]) {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    task.update(&RobotState { model, kinematics: &kinematics, q });
}

fn pose(model: &Model, frame: FrameId, q: &[f64]) -> Isometry3<f64> {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    kinematics.pose(model, frame)
}

/// `S e` from its definition: position and rotation vector in the axes, by matrix products.
fn weighed_error(
    axes: PoseAxes,
    (position, orientation): (&Matrix3<f64>, &Matrix3<f64>),
    pose: &Isometry3<f64>,
    target: &Isometry3<f64>,
) -> Vector6<f64> {
    let to_world = match axes {
        PoseAxes::Frame => *pose.rotation.to_rotation_matrix().matrix(),
        PoseAxes::Target => *target.rotation.to_rotation_matrix().matrix(),
        PoseAxes::World => Matrix3::identity(),
    };
    let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
    let p = position * to_world.transpose() * (target.translation.vector - pose.translation.vector);
    let o = orientation * to_world.transpose() * turn;
    Vector6::new(p.x, p.y, p.z, o.x, o.y, o.z)
}

fn matrix(random: &mut Random) -> Matrix3<f64> {
    Matrix3::from_fn(|_, _| random.within(1.0))
}

fn anywhere(random: &mut Random) -> Isometry3<f64> {
    let mut three = || Vector3::from_fn(|_, _| random.within(1.0));
    Isometry3::new(three(), three())
}

#[test]
fn rows_and_feed_forward_are_derivatives_of_the_error() {
    let (mut random, h) = (Random(41), 1e-6);
    for (name, link) in [("panda", "panda_hand_tcp"), ("humanoid", "left_palm")] {
        let model = load(name, std::path::Path::new(".")).unwrap().model;
        let frame = model.frame(link).unwrap();
        for axes in ALL {
            let (position, orientation) = (matrix(&mut random), matrix(&mut random));
            let (neutral, mut q) = (model.neutral(), model.neutral());
            let step: Vec<f64> = (0..model.nv()).map(|_| random.within(0.5)).collect();
            model.integrate(&neutral, &step, &mut q);
            let target = pose(&model, frame, &q) * anywhere(&mut random);
            let velocity =
                Twist { linear: Vector3::new(0.3, -0.2, 0.5), angular: Vector3::new(-0.4, 0.1, 0.7) };
            let shares = AxisShares::matrices(axes, position, orientation);
            let settings = CartesianSettings { gain: 0.0, shares: Some(shares), ..Default::default() };
            let mut task = CartesianTask::new(&model, frame).with(settings);
            task.set_moving_target(target, velocity, Twist::zero());
            update(&mut task, &model, &q);

            let moved = |time: f64| {
                let rotation = UnitQuaternion::from_scaled_axis(velocity.angular * time) * target.rotation;
                Isometry3::from_parts((target.translation.vector + velocity.linear * time).into(), rotation)
            };
            let error = |time: f64, q: &[f64]| {
                weighed_error(axes, (&position, &orientation), &pose(&model, frame, q), &moved(time))
            };
            let rate = (error(h, &q) - error(-h, &q)) / (2.0 * h);
            assert!((task.desired() - rate).amax() < 1e-7, "{name} {axes:?}: {} {rate}", task.desired());
            for joint in 0..model.nv() {
                let at = |h: f64| {
                    let (mut step, mut there) = (vec![0.0; model.nv()], q.clone());
                    step[joint] = h;
                    model.integrate(&q, &step, &mut there);
                    error(0.0, &there)
                };
                let (rate, found) =
                    ((at(h) - at(-h)) / (2.0 * h), task.jacobian().column(joint).into_owned());
                assert!((found + rate).amax() < 1e-7, "{name} {axes:?} {joint}: {found} {rate}");
            }
        }
    }
}

#[test]
fn a_weighted_error_decays_within_its_maximum_speed() {
    let (panda, mut random) = (Panda::new(), Random(42));
    let q = panda.near_home(0.5, &mut random);
    let target = panda.hand_at(&q) * anywhere(&mut random);
    for axes in ALL {
        let (position, orientation) = (matrix(&mut random), matrix(&mut random));
        let shares = AxisShares::matrices(axes, position, orientation);
        let settings = CartesianSettings { gain: 4.0, shares: Some(shares), ..Default::default() };
        let mut task = CartesianTask::new(&panda.model, panda.hand).with(settings);
        task.set_target(target);
        update(&mut task, &panda.model, &q);
        let error = weighed_error(axes, (&position, &orientation), &panda.hand_at(&q), &target);
        assert!((task.desired() - error * 4.0).amax() < 1e-12, "{axes:?}");
        task.set_settings(CartesianSettings { max_linear_speed: 0.1, ..settings });
        update(&mut task, &panda.model, &q);
        let scale = task.desired().norm() / (error * 4.0).norm();
        assert!((task.desired() - error * 4.0 * scale).amax() < 1e-12, "the direction is kept");
        // free directions, however far away, do not slow down the rest
        let shares = AxisShares::new(axes, [1.0, 0.0, 0.0], [0.0; 3]);
        task.set_settings(CartesianSettings { max_linear_speed: 1e3, shares: Some(shares), ..settings });
        task.set_target(Isometry3::from(Vector3::new(0.0, 1e6, 1e6)) * target);
        update(&mut task, &panda.model, &q);
        assert!((task.desired().rows(1, 5)).amax() == 0.0, "{axes:?}: {}", task.desired());
    }
}

#[test]
fn a_hand_reaches_a_height_and_leaves_other_axes_free() {
    let panda = Panda::new();
    let start = panda.hand_at(panda.home.as_slice());
    let mut target = Isometry3::from(Vector3::new(0.5, -0.4, 0.1)) * start;
    target.rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0) * target.rotation;
    let shares = AxisShares::new(PoseAxes::World, [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]);
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    let settings = CartesianSettings { shares: Some(shares), ..Default::default() };
    reach.task.set_settings(settings);
    reach.task.set_target(target);
    let mut away = panda.home.clone();
    away[0] += 0.6;
    reach.posture = PostureTask::new(&panda.model, away.as_slice());
    reach.run(5.0, 1e-3);
    let end = panda.hand_at(reach.setpoint.position());
    assert!((end.translation.z - start.translation.z - 0.1).abs() < 1e-6, "{}", end.translation);
    let up = |pose: &Isometry3<f64>| pose.rotation.inverse() * Vector3::z();
    assert!(up(&end).angle(&up(&start)) < 1e-6, "as upright as at the start");
    // the posture turned the base; neither the target nor a free axis prevented it
    let turned = (end.rotation * start.rotation.inverse()).scaled_axis();
    assert!((turned.z - 0.6).abs() < 0.05, "{turned}");
    assert_eq!(reach.task.error().fixed_rows::<2>(0).amax(), 0.0);
}

#[test]
fn a_row_of_a_matrix_holds_the_hand_in_a_plane() {
    let panda = Panda::new();
    let normal = Vector3::new(1.0, 2.0, -2.0) / 3.0;
    let shares = AxisShares::matrices(
        PoseAxes::World,
        Matrix3::from_rows(&[normal.transpose(), Vector3::zeros().transpose(), Vector3::zeros().transpose()]),
        Matrix3::zeros(),
    );
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    reach.task.set_settings(CartesianSettings { shares: Some(shares), ..Default::default() });
    let (start, offset) = (panda.hand_at(panda.home.as_slice()), Vector3::new(0.1, 0.05, -0.1));
    reach.task.set_target(Isometry3::from(offset) * start);
    reach.run(3.0, 1e-3);
    let moved = panda.hand_at(reach.setpoint.position()).translation.vector - start.translation.vector;
    assert!((normal.dot(&moved) - normal.dot(&offset)).abs() < 1e-6, "{moved}");
    assert!((moved - offset).norm() > 0.02, "must move within the plane: {moved}");
}

#[test]
fn free_axes_of_a_level_are_left_to_the_levels_below() {
    let panda = Panda::new();
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, panda.home.as_slice());
    let state = RobotState { model: &panda.model, kinematics: &kinematics, q: panda.home.as_slice() };
    let hand_of = |shares: AxisShares, offset: Vector3<f64>| {
        let settings = CartesianSettings { shares: Some(shares), damping: 0.0, ..Default::default() };
        let mut hand = CartesianTask::new(&panda.model, panda.hand).with(settings);
        hand.set_target(Isometry3::from(offset) * panda.hand_at(panda.home.as_slice()));
        hand
    };
    let of = |position| AxisShares::new(PoseAxes::World, position, [0.0; 3]);
    let mut height = hand_of(of([0.0, 0.0, 1.0]), Vector3::new(0.0, 0.0, 0.01));
    let mut place = hand_of(of([1.0, 1.0, 1.0]), Vector3::new(0.02, 0.03, -1.0));
    let mut ik = DifferentialIk::new(&panda.model).levels(&[height.rows(), place.rows()]);
    ik.begin();
    ik.add_task(&state, 0, &mut height);
    ik.add_task(&state, 1, &mut place);
    let v = nalgebra::DVector::from_column_slice(ik.solve().unwrap());
    let speed = place.jacobian() * v;
    for (found, wanted) in speed.iter().zip([0.2, 0.3, 0.1]) {
        assert!((found - wanted).abs() < 1e-4, "{speed}");
    }
}

#[test]
fn a_controller_uses_its_axes_and_refuses_empty_ones() {
    let tasks =
        |axes: &str| format!("{{ tasks = [{{ cartesian = {{ axes = {axes} }} }}, {{ posture = {{}} }}] }}");
    let along = |axes: &str| {
        let report = run(graph("{}", Targets::default(), controller(&tasks(axes))));
        let result = report.results["controller"].clone();
        assert_eq!(result["goals_reached"], 2, "free axes have no error: {result}");
        let component = report.components.iter().find(|component| component.name == "controller").unwrap();
        assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
        (number(&report.results["plant"]["hand"][1]), result)
    };
    let (whole, _) = along("{}");
    let (free, result) = along("{ of = \"world\", position = [1, 0, 1], orientation = [0, 0, 0] }");
    assert!((whole - free).abs() > 0.05, "{whole} {free}");
    assert!(result["tasks"]["cartesian"]["orientation_error_rad"].is_null(), "{result}");
    let (turned, _) = along("{ of = \"target\", position = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }");
    assert!((whole - turned).abs() < 1e-4, "{whole} {turned}");

    let refused = |axes: &str, words: &[&str]| {
        let graph = graph("{}", Targets::default(), controller(&tasks(axes)));
        let error = graph.check().expect_err("it must be refused").render(false);
        for word in words {
            assert!(error.contains(word), "no `{word}` in\n{error}");
        }
    };
    refused(
        "{ position = [1, 0, 2] }",
        &["tasks[0].cartesian.axes.position", "2, expected a number from 0 to 1"],
    );
    refused("{ orientation = [[1, 0, 0], [0, -3, 0], [0, 0, 1]] }", &["axes.orientation", "from -1 to 1"]);
    refused("{ position = [1, 0] }", &["position", "expected three numbers"]);
    refused("{ position = [0, 0, 0], orientation = [0, 0, 0] }", &["tasks[0].cartesian.axes", "free"]);
    refused("{ of = \"tool\" }", &["tool", "frame"]);
}
