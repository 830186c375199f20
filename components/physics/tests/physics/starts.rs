//! Objects that start in motion or in the air, on every engine.

use motorium_physics::{BuildWarning, Object, ObjectShape, Options, World};
use motorium_robots::{MimicMode, Model, PackagePath, parse_urdf};
use motorium_worlds::MeshCollision;
use nalgebra::Vector3;

use crate::conformance::object;
use crate::engines::{Engine, engines};
use crate::meshes::{box_between, mesh};

const DT: f64 = 1e-3;

/// Two fingers 5 mm apart, one of which hangs on a knuckle without a shape: links with the same parent would
/// not be checked for collision.
fn fingers() -> Model {
    let link = |name: &str, parent: &str, y: f64, shape: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="0.1"/>
  <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>
<joint name="{name}_joint" type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="0 {y} 0"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="10" velocity="5"/></joint>"#
        )
    };
    let block = r#"<collision><geometry><box size="0.05 0.02 0.1"/></geometry></collision>"#;
    let text = format!(
        "<robot name=\"fingers\"><link name=\"palm\"/>{}{}{}</robot>",
        link("left", "palm", 4.9875, block),
        link("knuckle", "palm", 5.0, ""),
        link("right", "knuckle", 0.0125, block)
    );
    parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn objects_start_with_their_velocities_after_a_reset() {
    let (linear, angular) = (Vector3::new(1.0, 0.5, 0.0), Vector3::new(0.0, 0.0, 3.0));
    for engine in engines() {
        let puck = Object {
            velocity: linear.into(),
            angular_velocity: angular.into(),
            ..object("puck", ObjectShape::Sphere { radius: 0.05 }, Some(1.0), [0.0; 3])
        };
        let world = World { gravity: [0.0; 3], objects: vec![puck], ..World::default() };
        let mut simulation = engine.simulate(fingers(), world, &[0.0; 3], Options::default());
        let close = |warning: &BuildWarning| matches!(warning, BuildWarning::SelfCollisionOff { .. });
        assert!(simulation.warnings().iter().any(close), "{engine:?}: the links are close");
        let id = simulation.object("puck").unwrap();
        for start in ["at first", "after a reset"] {
            let (v, w) = simulation.object_velocity(id);
            assert!(
                (v - linear).norm() < 1e-9 && (w - angular).norm() < 1e-9,
                "{engine:?}, {start}: {v}, {w}"
            );
            (0..200).for_each(|_| _ = simulation.step(DT).unwrap());
            let way = simulation.object_pose(id).translation.vector;
            assert!((way - linear * 0.2).norm() < 1e-6, "{engine:?}, {start}: {way}");
            simulation.reset(&[0.0; 3], &[0.0; 3]).unwrap();
        }
    }
}

#[test]
fn a_tumbling_rock_rests_on_one_of_its_faces() {
    let half = [0.03, 0.025, 0.02];
    for engine in engines() {
        let table = object("table", ObjectShape::Box { size: [0.4, 0.8, 0.1] }, None, [0.6, 0.0, 0.05]);
        let rock = Object {
            mass: Some(0.3),
            position: [0.66, 0.22, 0.3],
            rpy: [0.3, 0.2, 0.0],
            ..mesh("rock", box_between([-0.03, -0.025, -0.02], half), MeshCollision::Hull)
        };
        let world = World { objects: vec![table, rock], ..World::default() };
        let mut simulation = crate::meshes::simulate(engine, world);
        (0..2500).for_each(|_| _ = simulation.step(DT).unwrap());
        let id = simulation.object("rock").unwrap();
        let mut up = 0.0;
        for _ in 0..400 {
            simulation.step(DT).unwrap();
            simulation.visit_contacts(&mut |contact| {
                let sign = if contact.second == "rock" { 1.0 } else { -1.0 };
                up += sign * contact.force * contact.normal.z / 400.0;
            });
        }
        let at = simulation.object_pose(id);
        // The axis that is upright, and its deviation from the vertical.
        let (face, upright) = (0..3)
            .map(|axis| (axis, (at.rotation * Vector3::ith(axis, 1.0)).z.abs()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(upright > 1.0 - 1e-4, "{engine:?}: it stands on an edge: {at}");
        let height = at.translation.z - 0.1;
        assert!((height - half[face]).abs() < 1e-3, "{engine:?}: {height} m on face {face}");
        let (linear, angular) = simulation.object_velocity(id);
        assert!(linear.norm() < 5e-3 && angular.norm() < 0.2, "{engine:?}: {linear} m/s, {angular} rad/s");
        // Rapier reports too high forces of hulls on a box.
        let most = if engine == Engine::Rapier { 0.5 } else { 0.05 };
        assert!((up - 0.3 * 9.81).abs() < most * 0.3 * 9.81, "{engine:?}: carried with {up} N");
    }
}
