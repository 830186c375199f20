//! Limits as control barriers: once they hold, they continue to hold under any task.

use motorium_control::tasks::Feedback;
use motorium_control::tasks::{CartesianSettings, CentreOfMassTask};
use motorium_control::{
    DifferentialIk, RobotState,
    inverse_dynamics::{DynamicsRows, InverseDynamics, InverseDynamicsSettings},
    limits::{
        CartesianPositionLimit, CartesianVelocityLimit, CollisionLimit, CollisionSettings, PositionLimit,
        RowLimit, SupportLimit, Supported, VelocityLimit,
    },
    tasks::{CartesianTask, PostureTask},
};
use motorium_robots::{CollisionModel, CollisionOptions, Reference};
use nalgebra::{DVector, Isometry3, Matrix6xX, Unit, Vector2, Vector3};

use crate::robots::{Random, Robot};

const DT: f64 = 1e-3;

/// Settings without torque limits and without relaxation.
fn strict() -> InverseDynamicsSettings {
    InverseDynamicsSettings { torque_fraction: 1e6, relaxation: None, ..InverseDynamicsSettings::default() }
}

/// Panda in random motion within its joint limits.
fn panda(random: &mut Random) -> Robot {
    let mut robot = Robot::new("panda");
    for joint in 0..7 {
        robot.q[joint] += random.within(0.3);
        robot.v[joint] = random.within(0.4);
    }
    robot.update();
    robot
}

#[test]
fn joints_and_hand_keep_velocity_limits_from_every_state() {
    let mut random = Random(41);
    for case in 0..40 {
        let mut robot = panda(&mut random);
        let model = robot.model.clone();
        for joint in 0..7 {
            let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
            robot.q[joint] = lower + (upper - lower) * random.next();
        }
        robot.update();
        let hand = model.frame("panda_hand_tcp").unwrap();
        let normal = Unit::new_normalize(random.vector(1.0) + Vector3::new(0.0, 0.0, 1e-3));
        let wall = |robot: &Robot| normal.dot(&robot.kinematics.pose(&model, hand).translation.vector);
        let place = wall(&robot) + 0.05 * random.next();
        let mut limit = CartesianPositionLimit::new(&model, hand, vec![(normal, place)]);
        let mut reach = CartesianTask::new(&model, hand);
        let far = robot.kinematics.pose(&model, hand).translation.vector + normal.into_inner();
        reach.set_target(Isometry3::from_parts(far.into(), random.rotation()));
        let wild: Vec<f64> = (0..model.nv()).map(|_| random.within(6.0)).collect();
        let mut posture = PostureTask::new(&model, &wild);
        let mut ik = DifferentialIk::with_rows(&model, limit.rows());
        for _ in 0..400 {
            let state = RobotState { model: &model, kinematics: &robot.kinematics, q: &robot.q };
            ik.begin();
            ik.add_task(&state, 0, &mut reach);
            ik.add_task(&state, 0, &mut posture);
            ik.add_limit(&state, &PositionLimit::default(), DT);
            ik.add_limit(&state, &VelocityLimit::default(), DT);
            ik.add_row_limit(&state, &mut limit, DT);
            let v = ik.solve().unwrap().to_vec();
            for (q, v) in robot.q.iter_mut().zip(&v) {
                *q += v * DT;
            }
            robot.update();
            for (joint, q) in robot.q.iter().enumerate() {
                let within = *q >= model.lower()[joint] - 1e-12 && *q <= model.upper()[joint] + 1e-12;
                assert!(
                    within && v[joint].abs() <= model.velocity_limit()[joint],
                    "case {case}, joint {joint}"
                );
            }
            // a step along the tangent leaves a curved path by the square of its length
            assert!(wall(&robot) <= place + 2e-5, "case {case}: {}", wall(&robot) - place);
        }
    }
}

#[test]
fn torques_keep_a_hand_behind_a_wall_from_feasible_states() {
    let mut random = Random(42);
    let (mut arrived, mut fastest) = (0, 0.0_f64);
    for case in 0..30 {
        let mut robot = panda(&mut random);
        let model = robot.model.clone();
        let hand = model.frame("panda_hand_tcp").unwrap();
        let normal = Unit::new_normalize(random.vector(1.0) + Vector3::new(0.0, 0.0, 1e-3));
        let speed = |robot: &Robot| robot.kinematics.velocity(&model, hand).linear;
        let at = |robot: &Robot| normal.dot(&robot.kinematics.pose(&model, hand).translation.vector);
        // admissible: h' >= -rate h, and within the speed limit
        let (rate, most) = (5.0, speed(&robot).amax() * (1.0 + random.next()) + 0.05);
        let place = at(&robot) + normal.dot(&speed(&robot)).max(0.0) / rate + 0.02 * random.next();
        let mut wall = CartesianPositionLimit::new(&model, hand, vec![(normal, place)]).with(rate, 0.0);
        let mut slow = CartesianVelocityLimit::new(&model, hand, most, f64::INFINITY);
        let mut reach = CartesianTask::new(&model, hand)
            .with(CartesianSettings::geometric())
            .feedback(Feedback::critical(15.0));
        let far = robot.kinematics.pose(&model, hand).translation.vector + 0.4 * normal.into_inner();
        reach.set_target(Isometry3::from_parts(far.into(), random.rotation()));
        let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(5.0)).weight(0.1);
        let room = DynamicsRows { limits: wall.rows() + slow.rows(), constrained: 0 };
        let mut control = InverseDynamics::with_room(&model, Vec::new(), strict(), room);
        for _ in 0..600 {
            control.begin(&robot.state(), DT);
            control.add_task(&robot.state(), 0, &mut reach);
            control.add_task(&robot.state(), 0, &mut posture);
            control.add_row_limit(&robot.state(), &mut wall, DT);
            control.add_row_limit(&robot.state(), &mut slow, DT);
            let acceleration = control.solve().unwrap().acceleration.clone();
            robot = robot.after(&acceleration, DT);
            assert!(at(&robot) <= place + 1e-4, "case {case}: {} m beyond", at(&robot) - place);
            let beyond = speed(&robot).amax() - most;
            assert!(beyond < 2e-3 * (1.0 + most), "case {case}: {beyond} m/s too fast");
            fastest = fastest.max(speed(&robot).amax() / most);
        }
        arrived += usize::from(place - at(&robot) < 5e-3);
    }
    assert!(arrived > 20, "must reach the wall: {arrived} times");
    assert!(fastest > 0.98, "must use the speed limit: {fastest}");
}

#[test]
fn without_the_barrier_the_same_torques_go_through_the_wall() {
    let mut random = Random(42);
    let mut robot = panda(&mut random);
    let model = robot.model.clone();
    let hand = model.frame("panda_hand_tcp").unwrap();
    let start = robot.kinematics.pose(&model, hand);
    let mut reach = CartesianTask::new(&model, hand)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(15.0));
    reach.set_target(Isometry3::from_parts(
        (start.translation.vector + Vector3::x() * 0.1).into(),
        start.rotation,
    ));
    let mut control = InverseDynamics::with_settings(&model, Vec::new(), strict());
    for _ in 0..600 {
        control.begin(&robot.state(), DT);
        control.add_task(&robot.state(), 0, &mut reach);
        let acceleration = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&acceleration, DT);
    }
    let moved = robot.kinematics.pose(&model, hand).translation.vector.x - start.translation.vector.x;
    assert!(moved > 0.09, "{moved}");
}

#[test]
fn torques_keep_links_apart() {
    let mut robot = Robot::new("panda");
    let model = robot.model.clone();
    let hand = model.frame("panda_hand_tcp").unwrap();
    let mut solids =
        CollisionModel::new(&model, &CollisionOptions { self_collision: false, ..Default::default() })
            .unwrap();
    solids.add_half_space("table", Isometry3::translation(0.0, 0.0, 0.3));
    // the base stands below the table
    let above: Vec<String> =
        ["panda_hand", "panda_leftfinger", "panda_rightfinger"].map(String::from).to_vec();
    let names: Vec<bool> = (0..solids.pairs().len())
        .map(|pair| solids.pair_links(pair).iter().any(|link| above.iter().any(|name| name == link)))
        .collect();
    let mut index = 0;
    solids.retain_pairs(|_| {
        index += 1;
        names[index - 1]
    });
    assert!(!solids.pairs().is_empty());
    let settings = CollisionSettings { distance: 0.02, range: 0.5, ..CollisionSettings::default() };
    let mut limit = CollisionLimit::new(&model, solids, settings);
    let mut reach = CartesianTask::new(&model, hand)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(10.0));
    let mut target = robot.kinematics.pose(&model, hand);
    target.translation.vector.z = 0.1;
    reach.set_target(target);
    let mut posture = PostureTask::new(&model, &robot.q).feedback(Feedback::critical(5.0)).weight(0.1);
    let room = DynamicsRows { limits: limit.rows(), constrained: 0 };
    let mut control = InverseDynamics::with_room(&model, Vec::new(), strict(), room);
    let mut smallest = f64::INFINITY;
    for _ in 0..1500 {
        control.begin(&robot.state(), DT);
        control.add_task(&robot.state(), 0, &mut reach);
        control.add_task(&robot.state(), 0, &mut posture);
        control.add_row_limit(&robot.state(), &mut limit, DT);
        let acceleration = control.solve().unwrap().acceleration.clone();
        robot = robot.after(&acceleration, DT);
        smallest = smallest.min(limit.smallest_distance().unwrap_or(f64::INFINITY));
    }
    assert!(smallest > 0.0199, "{smallest} m");
    assert!(smallest < 0.025, "must come near the minimum distance: {smallest} m");
}

#[test]
fn torques_keep_the_centre_of_mass_above_the_feet() {
    let mut robot = Robot::new("humanoid");
    let model = robot.model.clone();
    let start = robot.kinematics.centre_of_mass(&model).position;
    let mut support = SupportLimit::new(&model, 8, Supported::CentreOfMass(5.0)).margin(0.02);
    let mut lean = CentreOfMassTask::new(&model).feedback(Feedback::critical(4.0));
    lean.set_target(start + Vector3::new(0.0, 0.3, 0.0));
    let mut posture = PostureTask::new(&model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(0.05);
    let room = DynamicsRows { limits: support.rows(), constrained: 0 };
    let settings = InverseDynamicsSettings::default();
    let mut control = InverseDynamics::with_room(&model, robot.feet(), settings, room);
    let mut edge = f64::NEG_INFINITY;
    for _ in 0..1200 {
        control.begin(&robot.state(), DT);
        let mut points = Vec::new();
        control.visit_support(&robot.state(), &mut |point| points.push(Vector2::new(point.x, point.y)));
        assert_eq!(points.len(), 8);
        edge = points.iter().fold(edge, |most, point| most.max(point.y));
        support.set_support(&points);
        control.add_task(&robot.state(), 0, &mut lean);
        control.add_task(&robot.state(), 0, &mut posture);
        control.add_row_limit(&robot.state(), &mut support, DT);
        let solution = control.solve().unwrap();
        assert!(solution.slack.is_none(), "{:?}", solution.slack);
        let acceleration = solution.acceleration.clone();
        robot = robot.after(&acceleration, DT);
    }
    let leant = robot.kinematics.centre_of_mass(&model).position.y;
    assert!(leant < edge - 0.0199, "{leant} m, with the edge at {edge} m");
    assert!(leant > edge - 0.03, "must lean close to the edge: {leant} m of {edge} m");
}

#[test]
fn velocity_limits_with_torques_do_not_allocate() {
    let robot = Robot::new("panda");
    let model = &robot.model;
    let hand = model.frame("panda_hand_tcp").unwrap();
    let mut slow = CartesianVelocityLimit::new(model, hand, 0.1, 1.0);
    let mut posture = PostureTask::new(model, &[1.0; 8]).feedback(Feedback::critical(5.0)).weight(1.0);
    let room = DynamicsRows { limits: slow.rows(), constrained: 0 };
    let mut control = InverseDynamics::with_room(model, Vec::new(), InverseDynamicsSettings::default(), room);
    let allocations = motorium::testing::allocations(|| {
        for _ in 0..3 {
            control.begin(&robot.state(), DT);
            control.add_task(&robot.state(), 0, &mut posture);
            control.add_row_limit(&robot.state(), &mut slow, DT);
            control.solve().unwrap();
        }
    });
    assert_eq!(allocations, 0);
    let mut jacobian = Matrix6xX::zeros(model.nv());
    robot.kinematics.jacobian(model, hand, Reference::LocalWorldAligned, &mut jacobian);
    let acceleration = DVector::clone(&control.solution().acceleration);
    assert!((jacobian * acceleration).fixed_rows::<3>(0).amax() < 10.0 + 1e-6);
}
