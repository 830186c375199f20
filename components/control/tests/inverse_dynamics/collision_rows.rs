//! Rows of distance limits: recovery from contradictory rows, witnesses, and ignored distances.

use motorium_control::tasks::Feedback;
use motorium_control::tasks::PostureTask;
use motorium_control::{
    DifferentialIk, IkRows, IkSettings, RobotState,
    inverse_dynamics::{
        DynamicsRows, InverseDynamics, InverseDynamicsSettings, JointAccelerationLimits, MotionState,
    },
    limits::{CartesianPositionLimit, CollisionLimit, CollisionSettings, RowLimit},
};
use motorium_robots::{
    BaseMode, CollisionModel, CollisionOptions, Geometry, Kinematics, LoadOptions, MeshMode, Model,
    parse_urdf_with,
};
use nalgebra::{Isometry3, Vector3};

use crate::distances::flying;

const DT: f64 = 1e-3;
const PLATE: &str = "<box size=\"0.3 0.2 0.04\"/>";

fn settings() -> CollisionSettings {
    CollisionSettings { distance: 0.03, range: 0.3, ..CollisionSettings::default() }
}

/// Walls next to a plate at the origin, each given by its centre and its sides.
fn walls(model: &Model, walls: &[([f64; 3], [f64; 3])]) -> CollisionModel {
    let mut solids = CollisionModel::new(model, &CollisionOptions::default()).unwrap();
    for (middle, size) in walls {
        let (at, wall) =
            (Isometry3::from(Vector3::from(*middle)), Geometry::Box { size: Vector3::from(*size) });
        solids.add_obstacle("wall", at, wall, MeshMode::default()).unwrap();
    }
    solids
}

/// 0.01 m below and above the plate, with a required distance of 0.03 m: each wall prevents recovery from the
/// other.
const SQUEEZE: [([f64; 3], [f64; 3]); 2] =
    [([0.0, 0.0, -0.08], [1.0, 1.0, 0.1]), ([0.0, 0.0, 0.08], [1.0, 1.0, 0.1])];

#[test]
fn squeezed_pair_does_not_stop_recovery_of_other_limits() {
    let model = flying(PLATE, BaseMode::Fixed);
    let (q, mut kinematics) = (vec![0.0; 6], Kinematics::new(&model));
    kinematics.update(&model, &q);
    let state = RobotState { model: &model, kinematics: &kinematics, q: &q };
    let beside = ([0.21, 0.0, 0.0], [0.1, 0.1, 0.005]);
    let three = [SQUEEZE[0], SQUEEZE[1], beside];
    let mut limit = CollisionLimit::new(&model, walls(&model, &three), settings());
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    ik.begin();
    ik.add_row_limit(&state, &mut limit, DT);
    let v = ik.solve().unwrap();
    assert!((v[0] + 0.01).abs() < 1e-6 && v[2].abs() < 1e-9, "{v:?}");

    let infinite = Vector3::repeat(f64::INFINITY);
    let frame = model.frame("l5").unwrap();
    let lower = Vector3::new(0.05, f64::NEG_INFINITY, f64::NEG_INFINITY);
    let mut soft = CartesianPositionLimit::within(&model, frame, lower, infinite);
    let mut limit = CollisionLimit::new(&model, walls(&model, &SQUEEZE), settings());
    let room = IkRows { limits: limit.rows(), soft: soft.rows(), held: 0 };
    let mut ik = DifferentialIk::with_room(&model, room, IkSettings::default());
    ik.begin();
    ik.add_soft_limit(&state, 0, &mut soft, 10.0, DT);
    ik.add_row_limit(&state, &mut limit, DT);
    let v = ik.solve().unwrap();
    assert!((v[0] - 0.01).abs() < 1e-6 && v[2].abs() < 1e-9, "{v:?}");
}

/// A body with three round feet in a row, 0.4 m apart.
fn three_feet() -> Model {
    let feet: String = [-0.4, 0.0, 0.4]
        .map(|x| {
            format!(
                "<collision><origin xyz=\"{x} 0 0\"/><geometry><cylinder radius=\"0.05\" length=\"0.04\"/></geometry></collision>"
            )
        })
        .concat();
    let text = format!(
        "<robot name=\"feet\"><link name=\"base\"/><link name=\"body\">{feet}</link>\
         <joint name=\"j\" type=\"prismatic\"><parent link=\"base\"/><child link=\"body\"/><axis xyz=\"0 0 1\"/>\
         <limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint></robot>"
    );
    parse_urdf_with(&text, None, &LoadOptions::default()).unwrap().model
}

#[test]
fn three_equally_near_flat_pairs_each_have_witnesses() {
    let model = three_feet();
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    for x in [-0.4, 0.0, 0.4] {
        // a square that cuts four corners off the octagon: as many corners as a pair has witnesses
        let at = Isometry3::translation(x, 0.0, -0.08);
        let pillar = Geometry::Box { size: Vector3::new(0.095, 0.095, 0.04) };
        solids.add_obstacle("pillar", at, pillar, MeshMode::default()).unwrap();
    }
    let (q, mut kinematics) = (vec![0.0], Kinematics::new(&model));
    kinematics.update(&model, &q);
    let mut limit = CollisionLimit::new(&model, solids, CollisionSettings { range: 0.1, ..settings() });
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    ik.begin();
    ik.add_row_limit(&RobotState { model: &model, kinematics: &kinematics, q: &q }, &mut limit, DT);
    let written = ik.problem().row_lower.iter().filter(|lower| lower.is_finite()).count();
    assert_eq!(written, 3 + 32, "three pairs, and all rows for witnesses");
}

#[test]
fn an_object_without_a_finite_pose_is_ignored() {
    let model = flying(PLATE, BaseMode::Fixed);
    let (q, mut kinematics) = (vec![0.0; 6], Kinematics::new(&model));
    kinematics.update(&model, &q);
    let mut solids = walls(&model, &SQUEEZE[..1]);
    let ball = Geometry::Sphere { radius: 0.1 };
    let far = Isometry3::translation(0.0, 0.0, 0.2);
    let ball = solids.add_obstacle("ball", far, ball, MeshMode::default()).unwrap();
    let mut limit =
        CollisionLimit::new(&model, solids, settings()).objects([(0, ball, Isometry3::identity())]);
    limit.move_object(0, &Isometry3::translation(f64::NAN, 0.0, 0.2));
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    ik.begin();
    ik.add_row_limit(&RobotState { model: &model, kinematics: &kinematics, q: &q }, &mut limit, DT);
    let v = ik.solve().unwrap();
    assert!(v[..2].iter().all(|v| v.abs() < 1e-9) && (v[2] - 0.01).abs() < 1e-6, "{v:?}");
}

/// Moves a plate at rest at the origin by torques for `ticks`, and returns its final position.
fn by_torques(walls_beside: &[([f64; 3], [f64; 3])], recovery: f64, most: f64, ticks: usize) -> Vec<f64> {
    let model = flying(PLATE, BaseMode::Fixed);
    let apart = CollisionSettings { recovery, ..settings() };
    let mut limit = CollisionLimit::new(&model, walls(&model, walls_beside), apart);
    let room = DynamicsRows { limits: limit.rows(), constrained: 0 };
    let joints = JointAccelerationLimits { max_acceleration: most, ..Default::default() };
    let settings =
        InverseDynamicsSettings { joints, torque_fraction: 1e6, relaxation: None, ..Default::default() };
    let mut control = InverseDynamics::with_room(&model, Vec::new(), settings, room);
    let mut still = PostureTask::new(&model, &[0.0; 6]).feedback(Feedback::critical(5.0)).weight(1.0);
    let (mut q, mut v, mut kinematics) = (vec![0.0; 6], vec![0.0; 6], Kinematics::new(&model));
    for _ in 0..ticks {
        kinematics.update_with_velocity(&model, &q, &v);
        let state = MotionState { model: &model, kinematics: &kinematics, q: &q, v: &v };
        control.begin(&state, DT);
        control.add_task(&state, 0, &mut still);
        control.add_row_limit(&state, &mut limit, DT);
        let a = control.solve().expect("staying in place must not be a contradiction").acceleration.clone();
        assert!(a.amax() <= most + 1e-9, "{a}");
        for ((q, v), a) in q.iter_mut().zip(&mut v).zip(a.iter()) {
            *q += (*v + 0.5 * a * DT) * DT;
            *v += a * DT;
        }
    }
    q
}

#[test]
fn a_squeezed_pair_does_not_block_others_under_torques() {
    let beside = ([0.21, 0.0, 0.0], [0.1, 0.1, 0.005]);
    // 0.01 m remain of the 0.03 m required from the wall beside it
    let q = by_torques(&[SQUEEZE[0], SQUEEZE[1], beside], 0.01, 1000.0, 6000);
    assert!(q[0] < -0.02 + 1e-4 && q[0] > -0.025, "must return from the wall beside it: {q:?}");
    assert!(q[2].abs() < 1e-6, "must stay between the other two: {q:?}");
    let squeezed = by_torques(&SQUEEZE, 0.01, 1000.0, 1000);
    assert!(squeezed.iter().all(|q| q.abs() < 1e-6), "{squeezed:?}");
}

#[test]
fn recovery_is_limited_by_the_accelerations() {
    // 0.1 m/s within one tick would be 100 m/s2
    for most in [1000.0, 20.0] {
        let q = by_torques(&SQUEEZE[..1], 0.3, most, 3000);
        assert!(q[2] > 0.02 - 1e-4 && q[2] < 0.025, "{most}: {q:?}");
    }
}
