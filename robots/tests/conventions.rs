//! The same motions in the coordinates of Pinocchio and MuJoCo, by vectors written by
//! `conventions/generate.py`.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{Dynamics, Kinematics, LoadOptions, Model, Reference, load, parse_urdf_with};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

fn vectors() -> Value {
    serde_json::from_str(include_str!("conventions/vectors.json")).unwrap()
}

fn rover() -> Model {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/conventions/rover.urdf");
    let model = load(file.to_str().unwrap(), Path::new(".")).unwrap().model;
    let document = vectors();
    for program in ["pinocchio", "mujoco"] {
        let joints: Vec<&str> = document["joints"][program]
            .as_array()
            .unwrap()
            .iter()
            .map(|name| name.as_str().unwrap())
            .collect();
        assert_eq!(model.joint_names(), joints, "{program} orders the joints of this file as we do");
    }
    model
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_vec(numbers(value))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    let rows: Vec<f64> = value.as_array().unwrap().iter().flat_map(numbers).collect();
    Matrix3::from_row_slice(&rows)
}

fn assert_close(ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len());
    for (ours, theirs) in ours.iter().zip(theirs) {
        assert_relative_eq!(ours, theirs, epsilon = 1e-11, max_relative = 1e-11);
    }
}

/// Asserts the pose and velocity `expected` of the link `name`.
fn assert_moves(model: &Model, q: &[f64], v: &[f64], name: &str, expected: &Value) {
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, q, v);
    let frame = model.frame(name).unwrap();
    let pose = kinematics.pose(model, frame);
    assert_relative_eq!(pose.translation.vector, vector(&expected["p"]), epsilon = 1e-11);
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    assert_relative_eq!(rotation, matrix(&expected["R"]), epsilon = 1e-11);
    let velocity = kinematics.velocity_in(model, frame, Reference::LocalWorldAligned);
    assert_relative_eq!(velocity.linear, vector(&expected["linear"]), epsilon = 1e-11);
    assert_relative_eq!(velocity.angular, vector(&expected["angular"]), epsilon = 1e-11);
}

/// Negates a quaternion where required: the same rotation may have either sign.
fn with_the_sign_of(theirs: &[f64], quaternion: std::ops::Range<usize>, mut ours: Vec<f64>) -> Vec<f64> {
    let product: f64 = quaternion.clone().map(|index| ours[index] * theirs[index]).sum();
    ours[quaternion].iter_mut().for_each(|part| *part *= product.signum());
    ours
}

#[test]
fn pinocchio_configurations_describe_the_same_motions() {
    let model = rover();
    for case in vectors()["cases"].as_array().unwrap() {
        let (theirs, v) = (numbers(&case["pinocchio"]["q"]), numbers(&case["pinocchio"]["v"]));
        let q = model.from_pinocchio(&theirs).unwrap();
        assert_eq!(q.len(), model.nq());
        for (name, position) in case["positions"].as_object().unwrap() {
            let index = model.nq() - model.joint_count() + model.joint_index(name).unwrap();
            assert_relative_eq!(q[index], position.as_f64().unwrap(), epsilon = 1e-12);
        }
        assert_eq!(model.velocity_from_pinocchio(&q, &v), v, "no planar joint here");
        for (name, link) in case["links"].as_object().unwrap() {
            assert_moves(&model, &q, &v, name, link);
        }
        assert_close(&model.to_pinocchio(&q), &theirs);
        // whole turns of a continuous joint are lost there
        let mut turned = q.clone();
        *turned.last_mut().unwrap() += 2.0 * std::f64::consts::TAU;
        assert_close(&model.to_pinocchio(&turned), &theirs);
    }
}

#[test]
fn difference_of_configurations_matches_pinocchio() {
    let model = rover();
    let document = vectors();
    let cases = document["cases"].as_array().unwrap();
    let mut whole = 0;
    for (case, after) in cases.iter().zip(cases.iter().cycle().skip(1)) {
        let ours = |case: &Value| model.from_pinocchio(&numbers(&case["pinocchio"]["q"])).unwrap();
        let (from, to) = (ours(case), ours(after));
        let (mut way, mut between) = (vec![0.0; model.nv()], vec![0.0; model.nq()]);
        model.difference(&from, &to, &mut way);
        model.interpolate(&from, &to, 0.3, &mut between);
        let theirs = numbers(&case["pinocchio"]["difference"]);
        let there = model.from_pinocchio(&numbers(&case["pinocchio"]["interpolated"])).unwrap();
        // A continuous joint is one unbounded angle here; Pinocchio uses the shorter rotation, at most half a
        // turn.
        let wheel = (way.len() - 1, between.len() - 1);
        let turns = ((way[wheel.0] - theirs[wheel.0]) / std::f64::consts::TAU).round();
        assert_relative_eq!(way[wheel.0] - turns * std::f64::consts::TAU, theirs[wheel.0], epsilon = 1e-11);
        assert_close(&way[..wheel.0], &theirs[..wheel.0]);
        let between = with_the_sign_of(&there, 3..7, between);
        assert_close(&between[..wheel.1], &there[..wheel.1]);
        if turns == 0.0 {
            whole += 1;
            assert_close(&between, &there);
        }
    }
    assert!(whole > 0 && whole < cases.len(), "{whole}");
}

#[test]
fn accelerations_and_efforts_match_pinocchio() {
    let model = rover();
    let mut dynamics = Dynamics::new(&model);
    for case in vectors()["cases"].as_array().unwrap() {
        let case = &case["pinocchio"];
        let (v, a) = (numbers(&case["v"]), numbers(&case["a"]));
        let q = model.from_pinocchio(&numbers(&case["q"])).unwrap();
        let mut tau = vec![0.0; model.nv()];
        dynamics.rnea(&model, &q, &v, &a, Vector3::zeros(), &mut tau);
        assert_close(&tau, &numbers(&case["tau"]));
    }
}

#[test]
fn mujoco_configurations_describe_the_same_motions() {
    let model = rover();
    for case in vectors()["cases"].as_array().unwrap() {
        let (qpos, qvel) = (numbers(&case["mujoco"]["qpos"]), numbers(&case["mujoco"]["qvel"]));
        let (q, v) = model.from_mujoco(&qpos, &qvel);
        for (name, link) in case["links"].as_object().unwrap() {
            assert_moves(&model, &q, &v, name, link);
        }
        let (back, back_v) = model.to_mujoco(&q, &v);
        assert_close(&back, &qpos);
        assert_close(&back_v, &qvel);
        // From one program to the other.
        let ours = model.from_pinocchio(&numbers(&case["pinocchio"]["q"])).unwrap();
        let (over, over_v) = model.to_mujoco(&ours, &numbers(&case["pinocchio"]["v"]));
        assert_close(&with_the_sign_of(&qpos, 3..7, over), &qpos);
        assert_close(&over_v, &qvel);
    }
}

#[test]
fn planar_joint_matches_pinocchio_in_fixed_axes() {
    let document = vectors();
    let urdf = document["planar"]["urdf"].as_str().unwrap();
    let model = parse_urdf_with(urdf, None, &LoadOptions::default()).unwrap().model;
    for case in document["planar"]["cases"].as_array().unwrap() {
        let theirs = numbers(&case["q"]);
        let q = model.from_pinocchio(&theirs).unwrap();
        assert_close(&model.to_pinocchio(&q), &theirs);
        // their velocity is along the axes of the body, ours along the plane's
        let v = numbers(&case["v"]);
        let ours = model.velocity_from_pinocchio(&q, &v);
        assert_moves(&model, &q, &ours, "plate", case);
        assert_close(&model.velocity_to_pinocchio(&q, &ours), &v);
        // efforts are dual to velocities: the power is the same
        let tau = [0.7, -1.1, 0.4];
        let theirs = model.velocity_to_pinocchio(&q, &tau);
        let power = |tau: &[f64], v: &[f64]| tau.iter().zip(v).map(|(tau, v)| tau * v).sum::<f64>();
        assert_relative_eq!(power(&theirs, &v), power(&tau, &ours), epsilon = 1e-12);
    }
}

#[test]
fn configuration_of_another_length_is_rejected() {
    let model = rover();
    let theirs = numbers(&vectors()["cases"][0]["pinocchio"]["q"]);
    assert!(model.from_pinocchio(&theirs[..theirs.len() - 1]).is_none());
    assert!(model.from_pinocchio(&[&theirs[..], &[0.0]].concat()).is_none());
    assert!(model.from_pinocchio(&theirs[..3]).is_none());
}
