//! Rows of distances: which come back where others contradict each other, which have witnesses, and what counts as no distance.

use motorium_control::{
    DifferentialIk, IkRows, IkSettings, RobotState,
    limits::{
        AccelerationLimit, CartesianPositionLimit, CollisionLimit, CollisionSettings, PositionLimit, RowLimit,
    },
};
use motorium_robots::{
    BaseMode, CollisionModel, CollisionOptions, Geometry, Kinematics, LoadOptions, MeshMode, Model,
    parse_urdf_with,
};
use nalgebra::{DVector, Isometry3, Vector3};

use crate::distances::flying;

const DT: f64 = 1e-3;
const PLATE: &str = "<box size=\"0.3 0.2 0.04\"/>";

fn settings() -> CollisionSettings {
    CollisionSettings { distance: 0.03, range: 0.3, ..CollisionSettings::default() }
}

/// Walls beside a plate at the origin, each by its middle and its sides.
fn walls(model: &Model, walls: &[([f64; 3], [f64; 3])]) -> CollisionModel {
    let mut solids = CollisionModel::new(model, &CollisionOptions::default()).unwrap();
    for (middle, size) in walls {
        let (at, wall) =
            (Isometry3::from(Vector3::from(*middle)), Geometry::Box { size: Vector3::from(*size) });
        solids.add_obstacle("wall", at, wall, MeshMode::default()).unwrap();
    }
    solids
}

/// 0.01 m below and above the plate, where 0.03 m are to be kept: neither lets the other's come back.
const SQUEEZE: [([f64; 3], [f64; 3]); 2] =
    [([0.0, 0.0, -0.08], [1.0, 1.0, 0.1]), ([0.0, 0.0, 0.08], [1.0, 1.0, 0.1])];

#[test]
fn a_pair_that_is_squeezed_does_not_keep_another_pair_or_a_soft_limit_from_coming_back() {
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

#[test]
fn what_is_too_near_comes_back_no_faster_than_its_joints_speed_up() {
    let model = flying(PLATE, BaseMode::Fixed);
    let solids = walls(&model, &SQUEEZE[..1]);
    let mut limit = CollisionLimit::new(&model, solids, settings());
    let most = 0.5;
    let slow = AccelerationLimit::new(&model, DVector::repeat(6, most), PositionLimit::default());
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    let (mut q, mut before, mut kinematics) = (vec![0.0; 6], vec![0.0; 6], Kinematics::new(&model));
    let mut fastest = 0.0_f64;
    for _ in 0..5000 {
        kinematics.update(&model, &q);
        let state = RobotState { model: &model, kinematics: &kinematics, q: &q };
        ik.begin();
        ik.add_limit(&state, &PositionLimit::default(), DT);
        ik.add_acceleration_limit(&state, &slow, &before, DT);
        ik.add_row_limit(&state, &mut limit, DT);
        let v = ik.solve().unwrap().to_vec();
        assert!(!ik.is_hurried());
        for (now, before) in v.iter().zip(&before) {
            assert!((now - before).abs() <= most * DT * (1.0 + 1e-6), "{now} after {before}");
        }
        fastest = fastest.max(v[2]);
        q.iter_mut().zip(&v).for_each(|(q, v)| *q += v * DT);
        before = v;
    }
    assert!((fastest - 0.01).abs() < 1e-4, "{fastest} m/s");
    let distance = limit.smallest_distance().unwrap();
    assert!((distance - 0.03).abs() < 1e-4, "{distance} m");
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
fn of_three_flat_pairs_that_are_equally_near_each_has_witnesses() {
    let model = three_feet();
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    for x in [-0.4, 0.0, 0.4] {
        // turned by half a corner: the two octagons have as many corners in common as a pair has witnesses, and more
        let turn = Vector3::z() * std::f64::consts::PI / 8.0;
        let at = Isometry3::new(Vector3::new(x, 0.0, -0.08), turn);
        let pillar = Geometry::Cylinder { radius: 0.05, length: 0.04 };
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
fn solids_whose_distance_is_not_found_neither_approach_nor_part() {
    // needles along one line, one in the other: no plane holds three of their differences
    let needle = "<box size=\"0.2 1e-12 1e-12\"/>";
    let model = flying(needle, BaseMode::Fixed);
    let (q, mut kinematics) = (vec![0.0; 6], Kinematics::new(&model));
    kinematics.update(&model, &q);
    let solids = walls(&model, &[([0.1, 0.0, 0.0], [0.2, 1e-12, 1e-12])]);
    let mut limit = CollisionLimit::new(&model, solids, settings());
    let mut ik = DifferentialIk::with_rows(&model, limit.rows());
    let state = RobotState { model: &model, kinematics: &kinematics, q: &q };
    for wanted in [0.1, -0.1, 0.0] {
        let posture = motorium_control::tasks::PostureSettings { gain: 1.0, weight: 1.0 };
        let mut target = vec![0.0; 6];
        target[0] = wanted;
        let mut posture = motorium_control::tasks::PostureTask::new(&model, &target).with(posture);
        ik.begin();
        ik.add_task(&state, 0, &mut posture);
        ik.add_row_limit(&state, &mut limit, DT);
        let v = ik.solve().unwrap()[0];
        assert!((v - wanted.min(0.0)).abs() < 1e-6, "{v} of {wanted} m/s");
        assert_eq!(limit.smallest_distance(), None);
    }
}
