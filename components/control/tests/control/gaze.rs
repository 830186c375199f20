//! Gaze tasks, compared with finite differences and the requested decay.

use approx::assert_abs_diff_eq;
use motorium::testing::allocations;
use motorium_control::{
    DifferentialIk, RobotState, SetpointIntegrator,
    tasks::{GazeSettings, GazeTask, PostureTask, VelocityTask},
};
use motorium_qp::{Problem, Structure};
use motorium_robots::{Kinematics, Model};
use nalgebra::{DMatrix, DVector, Unit, Vector3};

use crate::{
    component::number,
    graph::{Targets, controller, graph, run},
    robot::{Panda, Random},
};

fn gaze(model: &Model, axis: Vector3<f64>) -> GazeTask {
    GazeTask::new(model, model.frame("panda_hand_tcp").unwrap(), Unit::new_normalize(axis))
}

fn update(task: &mut GazeTask, model: &Model, q: &[f64]) {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    task.update(&RobotState { model, kinematics: &kinematics, q });
}

/// The direction from the hand to a point, in the axes of the hand.
fn direction(panda: &Panda, q: &[f64], point: Vector3<f64>) -> Vector3<f64> {
    let hand = panda.hand_at(q);
    hand.rotation.inverse_transform_vector(&(point - hand.translation.vector)).normalize()
}

#[test]
fn rows_are_the_derivatives_of_the_direction() {
    let panda = Panda::new();
    let mut random = Random(31);
    let h = 1e-6;
    for _ in 0..20 {
        let q = panda.near_home(1.0, &mut random);
        let mut any = || Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
        let (point, velocity, axis) = (any(), any(), any());
        let mut task = gaze(&panda.model, axis).with(GazeSettings { gain: 0.0, ..GazeSettings::default() });
        task.set_moving_target(point, velocity);
        update(&mut task, &panda.model, &q);
        let seen = direction(&panda, &q, point);
        for joint in 0..panda.model.nv() {
            let (mut ahead, mut behind) = (q.clone(), q.clone());
            ahead[joint] += h;
            behind[joint] -= h;
            let rate = (direction(&panda, &ahead, point) - direction(&panda, &behind, point)) / (2.0 * h);
            assert_abs_diff_eq!(
                task.jacobian().column(joint).into_owned(),
                -seen.cross(&rate),
                epsilon = 1e-7
            );
        }
        let ahead = direction(&panda, &q, point + velocity * h);
        let rate = (ahead - direction(&panda, &q, point - velocity * h)) / (2.0 * h);
        assert_abs_diff_eq!(task.desired(), seen.cross(&rate), epsilon = 1e-7);
    }
}

#[test]
fn error_turns_the_axis_even_from_directly_opposite() {
    let panda = Panda::new();
    let q = panda.home.as_slice();
    let hand = panda.hand_at(q);
    for (axis, ahead, angle) in [
        (Vector3::z(), Vector3::z(), 0.0),
        (Vector3::z(), Vector3::x(), core::f64::consts::FRAC_PI_2),
        (Vector3::y(), Vector3::new(0.0, 1.0, 1.0), core::f64::consts::FRAC_PI_4),
        (Vector3::z(), -Vector3::z(), core::f64::consts::PI),
    ] {
        let mut task = gaze(&panda.model, axis);
        task.set_target(hand.translation.vector + hand.rotation * ahead * 0.7);
        update(&mut task, &panda.model, q);
        assert_abs_diff_eq!(task.angle(), angle, epsilon = 1e-9);
        let turned = nalgebra::Rotation3::new(task.error()) * axis;
        assert_abs_diff_eq!(turned, ahead.normalize(), epsilon = 1e-9);
    }
    // a point at the origin of the frame has no direction, so there is no error
    let mut task = gaze(&panda.model, Vector3::z());
    task.set_target(hand.translation.vector);
    update(&mut task, &panda.model, q);
    assert_eq!(task.angle(), 0.0);
    assert!(task.jacobian().iter().all(|number| number.is_finite()));
}

#[test]
fn cost_is_the_weighted_square_of_the_error() {
    let panda = Panda::new();
    let q = panda.near_home(0.5, &mut Random(5));
    for max_speed in [f64::INFINITY, 0.3] {
        let settings = GazeSettings { gain: 4.0, weight: 2.0, max_speed, damping: 0.01 };
        let mut task = gaze(&panda.model, Vector3::z()).with(settings);
        task.set_target(Vector3::new(0.3, 0.4, 0.2));
        update(&mut task, &panda.model, &q);
        let correction = 4.0 * task.error() * (max_speed / (4.0 * task.angle())).min(1.0);
        assert_abs_diff_eq!(task.desired(), correction, epsilon = 1e-12);
        let n = panda.model.nv();
        let mut problem = Problem::new(&Structure::new(n));
        task.add_to(&mut problem);
        problem.hessian.fill_lower_triangle_with_upper_triangle();
        let a = DMatrix::from_fn(3, n, |i, j| 2.0 * task.jacobian()[(i, j)]);
        let b = DVector::from_column_slice((2.0 * correction).as_slice());
        let damping = 0.01 * (4.0 * correction).norm();
        assert_abs_diff_eq!(
            problem.hessian,
            a.tr_mul(&a) + DMatrix::identity(n, n) * damping,
            epsilon = 1e-12
        );
        assert_abs_diff_eq!(problem.gradient, -a.tr_mul(&b), epsilon = 1e-12);
    }
}

#[test]
fn the_angle_to_a_moving_point_decays_at_the_gain() {
    let panda = Panda::new();
    let model = &panda.model;
    let (gain, dt) = (5.0, 1e-3);
    let settings = GazeSettings { gain, damping: 0.0, ..GazeSettings::default() };
    let mut task = gaze(model, Vector3::z()).with(settings);
    let mut posture = PostureTask::new(model, panda.home.as_slice());
    let mut kinematics = Kinematics::new(model);
    let mut setpoint = SetpointIntegrator::new(model, panda.home.as_slice());
    let mut ik = DifferentialIk::new(model).levels(&[task.rows(), posture.rows()]);
    let velocity = Vector3::new(0.05, -0.1, 0.02);
    let mut point = panda.hand_at(panda.home.as_slice()).translation.vector + Vector3::new(0.3, 0.1, -0.5);
    let mut start = None;
    for tick in 0..1000 {
        let made = allocations(|| {
            task.set_moving_target(point, velocity);
            kinematics.update(model, setpoint.position());
            let state = RobotState { model, kinematics: &kinematics, q: setpoint.position() };
            ik.begin();
            ik.add_task(&state, 0, &mut task);
            ik.add_task(&state, 1, &mut posture);
            setpoint.integrate(ik.solve().unwrap(), dt);
        });
        assert_eq!(made, 0);
        let start = *start.get_or_insert(task.angle());
        let expected = start * (-gain * tick as f64 * dt).exp();
        assert!((task.angle() - expected).abs() < 0.01 * start, "tick {tick}: {} {expected}", task.angle());
        point += velocity * dt;
    }
    assert!(task.angle() < 0.01 * start.unwrap());
}

#[test]
fn a_controller_looks_at_the_goals_of_its_target() {
    let gaze = "gaze = { target = \"target\", tolerance = 1e-3 }";
    let velocities = format!("{{ tasks = [{{ {gaze} }}, {{ posture = {{ level = 2 }} }}] }}");
    let posture = "posture = { level = 2, weight = 1.0, gain = 3.0 }";
    let torques = format!("{{ inverse_dynamics = {{}}, tasks = [{{ {gaze} }}, {{ {posture} }}] }}");
    for config in [velocities, torques] {
        let points = Targets { start: Some([0.6, 0.0, 0.0]), ..Targets::default() };
        let report = run(graph("{}", points, controller(&config)));
        let gaze = &report.results["controller"]["tasks"]["gaze"];
        assert_eq!(gaze["goals_reached"], 2, "{config}: {gaze}");
        assert_eq!(gaze["goals_missed"], 0, "{config}: {gaze}");
        assert!(number(&gaze["orientation_error_rad"]) < 1e-3, "{config}: {gaze}");
    }
}
