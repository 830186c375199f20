//! Quantities of a model compared with MuJoCo's.

use motorium_robots::{Dynamics, Kinematics, Model};
use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Largest difference between two lists relative to the largest entry of the second, or to 1e-3 if that is
/// larger.
pub(crate) fn error(ours: &[f64], theirs: &[f64]) -> f64 {
    assert_eq!(ours.len(), theirs.len());
    let scale = theirs.iter().fold(1e-3_f64, |most, x| most.max(x.abs()));
    ours.iter().zip(theirs).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs())) / scale
}

/// Returns the matrix that converts our velocity to MuJoCo's, and the drift of its acceleration: both differ
/// for a floating base.
fn coordinates(model: &Model, q: &[f64], v: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let n = model.nv();
    let (mut turn, mut drift) = (DMatrix::identity(n, n), DVector::zeros(n));
    if model.base().floating {
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[6], q[3], q[4], q[5]));
        let rotation: Matrix3<f64> = rotation.to_rotation_matrix().into_inner();
        turn.view_mut((0, 0), (3, 3)).copy_from(&rotation);
        let (linear, angular) = (Vector3::from_column_slice(&v[..3]), Vector3::from_column_slice(&v[3..6]));
        // classical minus spatial acceleration
        drift.rows_mut(0, 3).copy_from(&angular.cross(&linear));
    }
    (turn, drift)
}

/// Compares a state of `robot` with MuJoCo's: calls `judge` with a name, our numbers and theirs.
pub(crate) fn case(model: &Model, case: &Value, check: &mut impl FnMut(&str, &[f64], &[f64])) {
    let n = model.nv();
    let (qpos, qvel) = (numbers(&case["qpos"]), numbers(&case["qvel"]));
    let (q, v) = model.from_mujoco(&qpos, &qvel);
    let (back, back_v) = model.to_mujoco(&q, &v);
    check("qpos there and back", &back, &qpos);
    check("qvel there and back", &back_v, &qvel);

    let (turn, drift) = coordinates(model, &q, &v);
    let ours = |theirs: &[f64]| turn.tr_mul(&DVector::from_column_slice(theirs));
    let mut dynamics = Dynamics::new(model);
    let mut mass = DMatrix::zeros(n, n);
    dynamics.crba(model, &q, &mut mass);
    let theirs = turn.transpose() * mass_matrix(&case["M"], n) * &turn;
    check("M", mass.as_slice(), theirs.as_slice());
    let mut tau = DVector::zeros(n);
    for (what, a) in [("bias", Some(vec![0.0; n])), ("inverse", case.get("a").map(numbers))] {
        let Some(a) = a else { continue };
        let a = ours(&a) - &drift;
        dynamics.rnea(model, &q, &v, a.as_slice(), GRAVITY, tau.as_mut_slice());
        check(what, tau.as_slice(), ours(&numbers(&case[what])).as_slice());
        let mut back = vec![0.0; n];
        let solved = dynamics.forward(model, &q, &v, tau.as_slice(), GRAVITY, &mut back).is_ok();
        let off = back.iter().zip(&a).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
        // computed by a factored mass matrix: 1e-8 instead of 1e-10 of 1e-3
        check("forward dynamics", &[if solved { 1e-5 * off } else { 1.0 }], &[0.0]);
    }
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &q);
    for (name, pose) in case["frames"].as_object().unwrap() {
        // in MuJoCo, the first link of a URDF fixed to the world is the world
        let Ok(frame) = model.frame(name) else { continue };
        let pose = numbers(pose);
        let found = kinematics.pose(model, frame);
        check(name, found.translation.vector.as_slice(), &pose[..3]);
        let turn = Quaternion::new(pose[3], pose[4], pose[5], pose[6]);
        check(name, &[found.rotation.angle_to(&UnitQuaternion::new_normalize(turn))], &[0.0]);
    }
}

/// A matrix of rows, or the upper triangle of a symmetric one row by row.
fn mass_matrix(rows: &Value, n: usize) -> DMatrix<f64> {
    if rows[0].is_array() {
        let rows: Vec<f64> = rows.as_array().unwrap().iter().flat_map(numbers).collect();
        return DMatrix::from_row_slice(n, n, &rows);
    }
    let triangle = numbers(rows);
    assert_eq!(triangle.len(), n * (n + 1) / 2);
    let start = |row: usize| row * n - row * row.saturating_sub(1) / 2;
    DMatrix::from_fn(n, n, |i, j| triangle[start(i.min(j)) + i.abs_diff(j)])
}
