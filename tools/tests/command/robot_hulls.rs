//! `motorium robot hulls`: robots whose meshes are convex.

use std::path::{Path, PathBuf};

use motorium_robots::{CollisionModel, CollisionOptions, Collisions, Kinematics, Model, TriangleMesh, load};
use nalgebra::{Isometry3, Translation3};

use crate::program::{complaint, json, printed};

/// An L of two boxes as an OBJ text: 1 m long and high, 0.2 m thick.
fn angle() -> String {
    let (mut corners, mut faces) = (String::new(), String::new());
    for (index, (low, high)) in
        [([0.0, 0.0, 0.0], [1.0, 0.2, 0.2]), ([0.0, 0.0, 0.2], [0.2, 0.2, 1.0])].into_iter().enumerate()
    {
        for corner in 0..8 {
            let at: Vec<String> = (0..3)
                .map(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] })
                .map(|x: f64| x.to_string())
                .collect();
            corners += &format!("v {}\n", at.join(" "));
        }
        for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            let [a, b, c, d] = face.map(|corner| corner + 8 * index);
            faces += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    }
    corners + &faces
}

/// A robot with a swinging L that is only a visual, and a base with a missing mesh.
fn robot(folder: &Path) -> String {
    let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let text = format!(
        "<robot name=\"swing\"><link name=\"base\"><collision><geometry><mesh filename=\"no.stl\"/></geometry></collision></link>
        <link name=\"arm\">{inertial}<visual><origin xyz=\"0 0 0.5\"/><geometry><mesh filename=\"angle.obj\" scale=\"2 2 2\"/>\
        </geometry></visual></link><joint name=\"hinge\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/>\
        <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint></robot>"
    );
    std::fs::write(folder.join("angle.obj"), angle()).expect("written");
    let file = folder.join("swing.urdf");
    std::fs::write(&file, text).expect("written");
    file.to_str().expect("a path of text").to_string()
}

/// Distance of a small box at this place from the robot; negative inside.
fn distance(model: &Model, at: [f64; 3]) -> f64 {
    let options = CollisionOptions { leave_out_defects: true, ..CollisionOptions::default() };
    let mut shapes = CollisionModel::new(model, &options).expect("shapes");
    let small = motorium_robots::Geometry::Sphere { radius: 0.01 };
    let place = Isometry3::from_parts(Translation3::new(at[0], at[1], at[2]), Default::default());
    shapes.add_obstacle("probe", place, small, Default::default()).expect("a sphere");
    let (mut state, mut kinematics) = (Collisions::new(&shapes), Kinematics::new(model));
    kinematics.update(model, &model.neutral());
    state.update(&shapes, &kinematics);
    state.nearest(&shapes).expect("a pair").distance
}

fn loaded(file: &str) -> Model {
    load(file, Path::new("")).unwrap_or_else(|error| panic!("{error}")).model
}

#[test]
fn visual_only_link_gets_a_hull_or_parts() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot(folder.path());
    assert!(loaded(&file).bodies()[0].shapes.is_empty(), "nothing collides before");
    let to = |name: &str| -> String { folder.path().join(name).to_str().expect("text").to_string() };
    let message = printed(&["robot", "hulls", &file, "--output", &to("hull")]);
    assert!(message.contains("arm: angle.obj: 1 part, ") && message.contains("swing.urdf"), "{message}");
    let parts = json(&["robot", "hulls", &file, "--output", &to("parts"), "--parts", "8", "--json"]);
    let files = parts["meshes"][0]["files"].as_array().expect("files").len();
    assert!((2..=8).contains(&files), "{parts}");

    // The L is 2 m long, 0.5 m above its link: only the hull fills the space between its legs.
    let (between, inside) = ([0.8, 0.2, 0.5 + 0.8], [0.2, 0.2, 0.5 + 1.0]);
    let (hull, cut) = (loaded(&to("hull/swing.urdf")), loaded(&to("parts/swing.urdf")));
    assert!(distance(&hull, between) < -0.05, "the hull fills the hollow");
    assert!(distance(&cut, between) > 0.2, "the parts do not: {}", distance(&cut, between));
    assert!(distance(&hull, inside) < 0.0 && distance(&cut, inside) < 0.0);
}

#[test]
fn missing_meshes_are_named_and_required() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot(folder.path());
    let out = folder.path().join("out");
    let out = out.to_str().expect("text");
    let output = crate::program::run(&["robot", "hulls", &file, "--output", out]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.contains("mesh no.stl was not found"), "{errors}");
    let own = folder.path().to_str().expect("text");
    assert!(complaint(&["robot", "hulls", &file, "--output", own]).contains("is the robot itself"));
    assert_eq!(loaded(&file).bodies()[0].shapes.len(), 0, "the robot is unchanged");
    let again = complaint(&["robot", "hulls", &file, "--output", out]);
    assert!(again.contains("swing.urdf exists: name another file"), "{again}");
    let mesh = PathBuf::from(out).join("meshes/arm_0.obj");
    std::fs::remove_file(PathBuf::from(out).join("swing.urdf")).expect("it was written");
    std::fs::write(&mesh, "mine").expect("a file");
    let again = complaint(&["robot", "hulls", &file, "--output", out]);
    assert!(again.contains("arm_0.obj exists"), "{again}");
    assert_eq!(std::fs::read(&mesh).expect("a file"), b"mine");
    assert!(!PathBuf::from(out).join("swing.urdf").exists(), "nothing is replaced");
    let message = complaint(&["robot", "hulls", "panda", "--output", out]);
    assert!(message.contains("no link of robot `panda` has a mesh"), "{message}");
    assert!(!PathBuf::from(out).join("panda.urdf").exists());
}

#[test]
fn angle_parts_keep_the_volume_and_its_hull_exceeds_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("angle.obj");
    std::fs::write(&file, angle()).expect("written");
    let angle = TriangleMesh::read(&file).expect("a mesh");
    assert!((angle.volume() - 0.072).abs() < 1e-9, "{}", angle.volume());
    let hull = angle.convex_parts(1, 64);
    assert!(hull.len() == 1 && hull[0].volume() > 0.12, "the hull fills the hollow");
    let parts = angle.convex_parts(8, 64);
    let volume: f64 = parts.iter().map(TriangleMesh::volume).sum();
    assert!((2..=8).contains(&parts.len()), "{} parts", parts.len());
    // Each side may grow by one of 64 voxels.
    let thick = 0.2 + 2.0 / 64.0;
    let grown = (1.0 + 2.0 / 64.0) * thick * thick + 0.8 * thick * thick;
    assert!((0.072..grown).contains(&volume), "{volume} m3, expected less than {grown}");
    assert!(parts.iter().all(|part| part.points.len() <= 64));
    std::fs::write(&file, hull[0].to_obj()).expect("written");
    let read = TriangleMesh::read(&file).expect("a mesh");
    assert_eq!(read.triangles, hull[0].triangles, "a written mesh is read unchanged");
}
