//! A scene with the features of MuJoCo Menagerie's files: nested includes, classes, inline meshes, position
//! drives, keyframes. `scene.py` writes MuJoCo's result.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use motorium_robots::{
    CollisionModel, CollisionOptions, Dynamics, Geometry, Kinematics, LoadOptions, MimicMode, ShapeSource,
    load, load_with, parse_mjcf,
};
use nalgebra::{DMatrix, Vector3};
use serde_json::Value;

use super::compare::numbers;

fn scene() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mujoco/scene/scene.xml")
}

fn golden() -> Value {
    serde_json::from_str(include_str!("scene.json")).unwrap()
}

fn independent() -> motorium_robots::Loaded {
    let options = LoadOptions { mimic: MimicMode::Independent, ..LoadOptions::default() };
    load_with(scene().to_str().unwrap(), Path::new(""), &options).unwrap()
}

#[test]
fn keyframe_poses_match_mujoco() {
    let robot = independent();
    let (model, profile) = (&robot.model, robot.profile.unwrap());
    assert_eq!(profile.home, "home");
    for (name, key) in golden()["keys"].as_object().unwrap() {
        let q = profile.pose(model, name).unwrap();
        assert_eq!(q.as_slice(), numbers(&key["qpos"]), "{name}");
        let mut mass = DMatrix::zeros(model.nv(), model.nv());
        let mut dynamics = Dynamics::new(model);
        dynamics.crba(model, q.as_slice(), &mut mass);
        let lower = (0..model.nv()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for ((i, j), expected) in lower.zip(numbers(&key["M"])) {
            assert_relative_eq!(mass[(i, j)], expected, epsilon = 1e-10);
        }
        let mut bias = vec![0.0; model.nv()];
        dynamics.gravity(model, q.as_slice(), Vector3::new(0.0, 0.0, -9.81), &mut bias);
        for (ours, theirs) in bias.iter().zip(numbers(&key["bias"])) {
            assert_relative_eq!(*ours, theirs, epsilon = 1e-10);
        }
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, q.as_slice());
        let grip = kinematics.pose(model, model.frame("grip").unwrap()).translation.vector;
        assert_relative_eq!(grip, Vector3::from_column_slice(&numbers(&key["site"])), epsilon = 1e-10);
    }
}

#[test]
fn position_drive_gains_and_limits_match_mujoco() {
    let robot = independent();
    let gains = robot.profile.unwrap().gains(&robot.model).unwrap();
    for (joint, drive) in golden()["drives"].as_object().unwrap() {
        let index = robot.model.joint_index(joint).unwrap();
        assert_relative_eq!(gains.kp[index], drive["kp"].as_f64().unwrap(), epsilon = 1e-9);
        assert_relative_eq!(gains.kd[index], drive["kd"].as_f64().unwrap(), epsilon = 1e-9);
        assert_relative_eq!(robot.model.effort_limit()[index], drive["effort"].as_f64().unwrap());
    }
    // driven through a tendon, which is not a joint drive here
    let finger = robot.model.joint_index("finger1").unwrap();
    assert_eq!(gains.kp[finger], 0.0);
    let warned: Vec<String> = robot.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warned.len(), 1, "{warned:?}");
    assert!(
        warned[0].starts_with("arm.xml: <general> of <actuator> ignored (line 68, column 5)"),
        "{warned:?}"
    );
}

#[test]
fn inline_meshes_collide_and_are_drawn() {
    let robot = load(scene().to_str().unwrap(), Path::new("")).unwrap();
    let solids = CollisionModel::new(&robot.model, &CollisionOptions::default()).unwrap();
    // The floor, a mesh each of base, shoulder, elbow and hand, and a box of each finger.
    assert_eq!(solids.solid_count(), 7);
    let shapes = robot.model.bodies().iter().flat_map(|body| &body.shapes);
    let hand = shapes.filter(|shape| shape.link == "hand").map(|shape| &shape.geometry).next().unwrap();
    let Geometry::Mesh { inline: Some(mesh), scale, .. } = hand else { panic!("{hand:?}") };
    // a tetrahedron given by its corners alone: the mesh is their hull
    assert_eq!((mesh.points.len(), mesh.triangles.len(), scale.y), (4, 4, 0.5));
    let options = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
    let seen = load_with(scene().to_str().unwrap(), Path::new(""), &options).unwrap();
    let links: Vec<&str> =
        seen.model.bodies().iter().flat_map(|body| &body.shapes).map(|shape| shape.link.as_str()).collect();
    assert_eq!(links, ["shoulder"]);
}

#[test]
fn errors_in_included_files_have_their_position() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let read = || {
        let path = folder.path().join("main.xml");
        parse_mjcf(&std::fs::read_to_string(&path).unwrap(), Some(&path), &LoadOptions::default())
            .unwrap_err()
            .to_string()
    };
    write(
        "main.xml",
        "<mujoco>\n<option/> <include file=\"part.xml\"/>\n<worldbody><geom siez=\"1\"/></worldbody></mujoco>",
    );
    write(
        "part.xml",
        "<mujoco>\n\n<worldbody>\n  <body name=\"b\"><joint axis=\"0 0\"/></body></worldbody></mujoco>",
    );
    assert!(read().contains("part.xml:4:18: axis=\"0 0\" of <joint>"), "{}", read());
    write("part.xml", "<mujoco>\n<size/></mujoco>");
    assert!(read().contains("main.xml:3:12: siez=\"1\" of <geom>"), "{}", read());
    write("part.xml", "<mujoco>\n<size></mujoco>");
    assert!(read().contains("part.xml:2:") && read().contains("not well-formed XML"), "{}", read());
    write("part.xml", "<mujoco><include file=\"main.xml\"/></mujoco>");
    assert!(
        read().contains("part.xml:1:9: <include> of \"main.xml\": each file can be included only once"),
        "{}",
        read()
    );
    std::fs::remove_file(folder.path().join("part.xml")).unwrap();
    assert!(read().contains("main.xml:2:11: <include> of \"part.xml\": cannot read"), "{}", read());
}

#[test]
fn invalid_keyframes_and_flat_meshes_are_rejected() {
    let refusal = |rest: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"b\"><joint name=\"one\"/><geom size=\"1\"/></body></worldbody>{rest}</mujoco>"
        );
        parse_mjcf(&text, None, &LoadOptions::default()).unwrap_err().to_string()
    };
    let key = refusal("<keyframe><key name=\"home\" qpos=\"0 0\"/></keyframe>");
    assert!(key.contains("qpos=\"0 0\" of <key name=\"home\">: expected a number"), "{key}");
    let flat = refusal("<asset><mesh name=\"m\" vertex=\"0 0 0 1 0 0 1 1 0 0 1 0\"/></asset>");
    assert!(flat.contains("corners that do not lie in one plane"), "{flat}");
    let few = refusal("<asset><mesh name=\"m\" vertex=\"0 0 0 1 0 0\"/></asset>");
    assert!(few.contains("three numbers for each of at least 4 corners"), "{few}");
    let wild = refusal("<asset><mesh name=\"m\" vertex=\"0 0 0 1 0 0 1 1 0 0 1 1\" face=\"0 1 7\"/></asset>");
    assert!(wild.contains("three numbers of corners"), "{wild}");
}
