//! Limits on combinations of velocities: planes, speeds, the support of the feet.

use motorium_control::{
    DifferentialIk, RobotState,
    limits::{CartesianPositionLimit, CentreOfMassVelocityLimit, RowLimit, SupportLimit, Supported},
    tasks::{
        CartesianTask, CentreOfMassSettings, CentreOfMassTask, ContactTask, MinimumVelocityTask, VelocityTask,
    },
};
use motorium_qp::Problem;
use motorium_robots::Kinematics;
use nalgebra::{DVector, Vector2, Vector3};

use crate::robots::{Random, Robot};

fn state(robot: &Robot) -> RobotState<'_> {
    RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q }
}

/// Problem with a single limit.
fn posed(robot: &Robot, limit: &mut dyn RowLimit, dt: f64) -> Problem {
    let mut ik = DifferentialIk::with_rows(&robot.model, limit.rows());
    ik.begin();
    ik.add_row_limit(&state(robot), limit, dt);
    ik.problem().clone()
}

/// Quantity of the robot after a time `h` with the velocity `v`.
fn after<T>(robot: &Robot, v: &DVector<f64>, h: f64, of: impl Fn(&Kinematics) -> T) -> T {
    let (mut q, mut kinematics) = (robot.q.clone(), Kinematics::new(&robot.model));
    robot.model.integrate(&robot.q, (v * h).as_slice(), &mut q);
    kinematics.update(&robot.model, &q);
    of(&kinematics)
}

#[test]
fn limit_rows_are_derivatives_on_fixed_and_floating_bases() {
    let mut random = Random(71);
    for name in ["panda", "humanoid"] {
        let robot = Robot::new(name).moved(&mut random);
        let model = &robot.model;
        let frame = model.frame(&model.frames().last().unwrap().name).unwrap();
        let v = DVector::from_fn(model.nv(), |_, _| random.within(1.0));
        let h = 1e-6;
        let place = |kinematics: &Kinematics| kinematics.pose(model, frame).translation.vector;
        let centre = |kinematics: &Kinematics| kinematics.centre_of_mass(model).position;
        let rate = |of: &dyn Fn(&Kinematics) -> Vector3<f64>| {
            (after(&robot, &v, h, of) - after(&robot, &v, -h, of)) / (2.0 * h)
        };
        let now = place(&robot.kinematics);

        let (lower, upper) = (now - Vector3::repeat(0.1), now + Vector3::new(0.2, 0.3, f64::INFINITY));
        let mut limit = CartesianPositionLimit::within(model, frame, lower, upper).with(4.0, 0.02);
        let problem = posed(&robot, &mut limit, 1e-3);
        let found = &problem.row_matrix * &v;
        let expected = rate(&place);
        for (row, (axis, sign, left)) in
            [(0, 1.0, 0.18), (0, -1.0, 0.08), (1, 1.0, 0.28), (1, -1.0, 0.08), (2, -1.0, 0.08)]
                .into_iter()
                .enumerate()
        {
            assert!((found[row] - sign * expected[axis]).abs() < 1e-6, "{name}, row {row}");
            assert!((problem.row_upper[row] - 4.0 * left).abs() < 1e-9, "{name}, row {row}");
        }

        let mut limit = CentreOfMassVelocityLimit::new(model, Vector3::new(0.1, f64::INFINITY, 0.3));
        let problem = posed(&robot, &mut limit, 1e-3);
        let (found, expected) = (&problem.row_matrix * &v, rate(&centre));
        assert!((found[0] - expected.x).abs() < 1e-6 && (found[1] - expected.z).abs() < 1e-6, "{name}");
        assert_eq!((problem.row_lower[1], problem.row_upper[1]), (-0.3, 0.3));

        // of the capture point: n' (c + c' / o) = d - margin where the row is at its bound
        let middle = centre(&robot.kinematics);
        let corners = [(0.2, 0.1), (-0.1, 0.15), (-0.15, -0.1), (0.1, -0.2)];
        let corners = corners.map(|(x, y)| middle.xy() + Vector2::new(x, y));
        let supported = Supported::CapturePoint { gravity: 9.81, ground: middle.z - 0.5 };
        let mut limit = SupportLimit::new(model, 6, supported).margin(0.02);
        limit.set_support(&corners);
        let problem = posed(&robot, &mut limit, 1e-3);
        let (found, expected) = (&problem.row_matrix * &v, rate(&centre).xy());
        assert_eq!(limit.edges().len(), 4);
        for (row, (normal, edge)) in limit.edges().iter().enumerate() {
            assert!((found[row] - normal.dot(&expected)).abs() < 1e-6, "{name}, row {row}");
            let at_bound = normal.dot(&middle.xy()) + problem.row_upper[row] / (9.81_f64 / 0.5).sqrt();
            assert!((at_bound - (edge - 0.02)).abs() < 1e-9, "{name}, row {row}: {at_bound} {edge}");
            // all corners lie inside, two of them on the edge
            let outside = corners.map(|corner| normal.dot(&corner) - edge);
            assert!(outside.iter().all(|place| *place < 1e-12));
            assert_eq!(outside.iter().filter(|place| place.abs() < 1e-12).count(), 2);
        }
        assert!(problem.row_upper.rows(4, 2).iter().all(|bound| *bound == f64::INFINITY));
    }
}

#[test]
fn hulls_ignore_corner_order_and_lines_do_not_bound() {
    let robot = Robot::new("panda");
    let mut random = Random(73);
    let mut limit = SupportLimit::new(&robot.model, 40, Supported::CentreOfMass(1.0));
    for _ in 0..50 {
        let points: Vec<_> = (0..40).map(|_| random.vector(1.0).xy()).collect();
        let made = motorium::testing::allocations(|| limit.set_support(&points));
        assert_eq!(made, 0);
        assert!(limit.edges().len() >= 3);
        for (normal, place) in limit.edges() {
            assert!((normal.norm() - 1.0).abs() < 1e-12);
            assert!(points.iter().all(|point| normal.dot(point) <= place + 1e-12));
        }
    }
    let line: Vec<_> = (0..5).map(|i| Vector2::new(f64::from(i), 2.0 * f64::from(i))).collect();
    for few in [&line[..], &line[..2], &line[..1], &[]] {
        limit.set_support(few);
        assert!(limit.edges().is_empty(), "{few:?}");
    }
}

#[test]
fn a_reaching_humanoid_keeps_its_balance_and_its_hand_limit() {
    let mut robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let mut feet: Vec<_> = robot.feet().iter().map(|foot| ContactTask::surface(&model, foot.frame)).collect();
    let hand = model.frame("left_palm").unwrap();
    let soles = robot.feet();
    let mut corners = Vec::new();
    for sole in &soles {
        let place = robot.kinematics.pose(&model, sole.frame).translation.vector;
        for (x, y) in [(0.1, 0.045), (0.1, -0.045), (-0.1, 0.045), (-0.1, -0.045)] {
            corners.push(place.xy() + Vector2::new(x, y));
        }
    }
    let margin = 0.02;
    let mut support = SupportLimit::new(&model, 8, Supported::CentreOfMass(5.0)).margin(margin);
    support.set_support(&corners);
    let wall = 0.25;
    let upper = Vector3::new(wall, f64::INFINITY, f64::INFINITY);
    let mut before_wall =
        CartesianPositionLimit::within(&model, hand, Vector3::repeat(f64::NEG_INFINITY), upper);
    let mut reach = CartesianTask::new(&model, hand);
    let mut target = robot.kinematics.pose(&model, hand);
    target.translation.vector.x += 1.0;
    reach.set_target(target);
    // the centre of mass is also requested to move forwards off the support
    let settings = CentreOfMassSettings { weight: 1.0, ..CentreOfMassSettings::default() };
    let mut lean = CentreOfMassTask::new(&model).with(settings);
    lean.set_target(robot.kinematics.centre_of_mass(&model).position + Vector3::new(0.5, 0.0, 0.0));
    let mut calm = MinimumVelocityTask::new(&model);
    let rows = support.rows() + before_wall.rows();
    let held = feet.iter().map(ContactTask::rows).sum();
    let mut ik = DifferentialIk::with_contacts(&model, held, rows);
    let dt = 5e-3;
    let (mut farthest, mut hand_x) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for _ in 0..600 {
        let now = state(&robot);
        ik.begin();
        feet.iter_mut().for_each(|foot| ik.hold(&now, foot));
        ik.add_task(&now, 0, &mut reach);
        ik.add_task(&now, 0, &mut lean);
        ik.add_task(&now, 0, &mut calm);
        ik.add_limit(&now, &motorium_control::limits::PositionLimit::default(), dt);
        ik.add_limit(&now, &motorium_control::limits::VelocityLimit::default(), dt);
        ik.add_row_limit(&now, &mut support, dt);
        ik.add_row_limit(&now, &mut before_wall, dt);
        let step: Vec<f64> = ik.solve().unwrap().iter().map(|v| v * dt).collect();
        let from = robot.q.clone();
        model.integrate(&from, &step, &mut robot.q);
        robot.update();
        farthest = farthest.max(robot.kinematics.centre_of_mass(&model).position.x);
        hand_x = hand_x.max(robot.kinematics.pose(&model, hand).translation.vector.x);
    }
    let edge = corners.iter().map(|corner| corner.x).fold(f64::NEG_INFINITY, f64::max) - margin;
    assert!(farthest < edge + 1e-3 && farthest > edge - 5e-3, "{farthest} m of {edge} m");
    assert!(hand_x < wall + 1e-3 && hand_x > wall - 5e-3, "{hand_x} m of {wall} m");
}
