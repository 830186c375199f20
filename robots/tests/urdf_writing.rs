//! Models written as URDF for viewers.

use std::path::Path;

use motorium_robots::{
    Kinematics, LinkColours, LoadOptions, MimicMode, Model, PackagePath, ShapeSource, draw_as_urdf, load,
    parse_urdf, parse_urdf_with,
};

#[test]
fn model_written_as_urdf_keeps_joints_and_poses() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mujoco");
    for name in ["arm.xml", "walker.xml", "runner.xml"] {
        let loaded = load(name, &folder).unwrap();
        let drawn = loaded.drawn().unwrap().unwrap();
        let again = parse_urdf(&drawn.text, None, MimicMode::Follow, &PackagePath::default());
        let again = again.unwrap_or_else(|error| panic!("{name}: {error}\n{}", drawn.text)).model;
        assert_eq!(again.joint_names(), loaded.model.joint_names(), "{name}");
        let pose = |model: &Model, frame: &str, root: &str| {
            let mut kinematics = Kinematics::new(model);
            let mut q = model.neutral();
            let joints = model.joint_count();
            let first = q.len() - joints;
            q[first..].iter_mut().enumerate().for_each(|(joint, q)| *q = 0.1 + 0.2 * joint as f64);
            kinematics.update(model, &q);
            let of = |name: &str| kinematics.pose(model, model.frame(name).unwrap());
            of(root).inv_mul(&of(frame))
        };
        let frames = loaded.model.frames();
        let root = frames.iter().find(|frame| frame.body.is_none() && !frame.in_world).unwrap().name.clone();
        for frame in frames.iter().filter(|frame| !frame.in_world) {
            let [one, other] = [&loaded.model, &again].map(|model| pose(model, &frame.name, &root));
            let apart = (one.to_homogeneous() - other.to_homogeneous()).norm();
            assert!(apart < 1e-9, "{name}: {} by {apart}", frame.name);
        }
        assert!(drawn.text.contains("<visual>"), "{name}");
    }
    let drawn = draw_as_urdf(&load("quadruped", Path::new(".")).unwrap().model);
    for (name, mesh) in &drawn.meshes {
        assert!(drawn.text.contains(name.as_str()) && mesh.is_closed(), "{name}");
    }
}

#[test]
fn collision_shapes_stand_in_for_meshes_in_their_colours() {
    for name in ["panda", "quadruped", "ur5e", "humanoid", "mobile-manipulator"] {
        let loaded = load(name, Path::new(".")).unwrap();
        let drawn = loaded.drawn().unwrap().unwrap();
        assert!(drawn.meshes.len() >= 10 && drawn.text.contains("<mesh"), "{name}");
        let plain = drawn.without_meshes();
        assert!(!plain.contains("<mesh"), "{name}");
        let visual = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
        let again = parse_urdf_with(&plain, None, &visual).unwrap().model;
        for (one, other) in loaded.model.bodies().iter().zip(again.bodies()) {
            assert_eq!(one.shapes, other.shapes, "{name}");
        }
        let colours = [&plain, &drawn.text].map(|text| LinkColours::of_urdf(text));
        for shape in loaded.model.bodies().iter().flat_map(|body| &body.shapes) {
            let [one, other] = colours.each_ref().map(|colours| colours.stated(&shape.link, 0));
            assert_eq!(one, other, "{name}: {}", shape.link);
        }
    }
}
