//! Line and face contacts transmit moments: bodies rest on narrower ones, and grippers hold them straight.

use motorium_physics::{ArticulatedSimulator, JointSetpoint, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::{MimicMode, Model, PackagePath, load, parse_urdf};
use motorium_worlds::MeshCollision;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::meshes::{box_between, mesh};

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Bars along z, 0.3 m long and 0.04 m thick.
fn bars() -> Vec<Object> {
    let (radius, length, size) = (0.02, 0.3, [0.04, 0.04, 0.3]);
    let hull = mesh("hull", box_between([-0.02, -0.02, -0.15], [0.02, 0.02, 0.15]), MeshCollision::Hull);
    let bar = |name: &str, shape| Object { name: name.to_owned(), shape, ..Object::default() };
    let mut bars = vec![
        bar("box", ObjectShape::Box { size }),
        bar("cylinder", ObjectShape::Cylinder { radius, length }),
        bar("capsule", ObjectShape::Capsule { radius, length: length - 2.0 * radius }),
        hull,
    ];
    bars.iter_mut().for_each(|bar| (bar.mass, bar.friction) = (Some(0.2), 0.8));
    bars
}

/// Distance \[m\] and angle \[rad\] between two poses.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}

/// Largest motion of an object from 0.5 s on, during `seconds` seconds, and its final speed.
fn drift(simulation: &mut dyn Simulator, name: &str, seconds: f64) -> (f64, f64, f64) {
    let id = simulation.object(name).unwrap();
    let mut start = simulation.object_pose(id);
    let (mut far, mut turned) = (0.0_f64, 0.0_f64);
    for step in 0..(seconds * 1e3) as usize {
        simulation.step(1e-3).unwrap();
        if step == 500 {
            start = simulation.object_pose(id);
        }
        if step > 500 {
            let (distance, angle) = apart(&start, &simulation.object_pose(id));
            (far, turned) = (far.max(distance), turned.max(angle));
        }
    }
    (far, turned, simulation.object_velocity(id).0.norm())
}

fn simulate(objects: Vec<Object>) -> ArticulatedSimulator {
    let model = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let world = World { objects, ..World::default() };
    ArticulatedSimulator::new(model, world, &[0.0], Options::default()).unwrap()
}

#[test]
fn bars_rest_across_beams_narrower_than_themselves() {
    for bar in bars() {
        for beam in bars() {
            for angle in [0.3, 0.7, QUARTER] {
                // The beam along x, and the bar above it rotated away from x.
                let lying = UnitQuaternion::from_euler_angles(0.0, QUARTER, 0.0);
                let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, angle) * lying;
                let rpy = |rotation: UnitQuaternion<f64>| rotation.euler_angles().into();
                let beam_at = |name: &str, y: f64| Object {
                    name: name.to_owned(),
                    mass: None,
                    position: [2.0, y, 0.02],
                    rpy: rpy(lying),
                    ..beam.clone()
                };
                let objects = vec![
                    beam_at("one", -0.03),
                    beam_at("two", 0.03),
                    Object {
                        name: "bar".to_owned(),
                        mass: Some(0.2),
                        position: [2.0, 0.0, 0.06],
                        rpy: rpy(turned),
                        ..bar.clone()
                    },
                ];
                let (far, angle_moved, speed) = drift(&mut simulate(objects), "bar", 4.0);
                let what = format!("{} on {} at {angle} rad", bar.name, beam.name);
                assert!(
                    far < 1e-4 && angle_moved < 1.7e-3 && speed == 0.0,
                    "{what}: {far} m, {angle_moved} rad, {speed} m/s"
                );
            }
        }
    }
}

/// Two pads of 6 cm that press along x.
fn gripper() -> Model {
    let pad = |name: &str, x: f64, axis: f64| {
        format!(
            r#"<link name="{name}"><inertial><mass value="0.2"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.02 0.06 0.06"/></geometry></collision></link>
  <joint name="{name}_joint" type="prismatic"><parent link="base"/><child link="{name}"/><origin xyz="{x} 0 0"/><axis xyz="{axis} 0 0"/>
  <limit lower="-0.1" upper="0.1" effort="200" velocity="2"/></joint>"#
        )
    };
    let (left, right) = (pad("left", -0.03, 1.0), pad("right", 0.03, -1.0));
    let text = format!(r#"<robot name="gripper"><link name="base"/>{left}{right}</robot>"#);
    parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn grippers_hold_bars_off_centre() {
    for bar in bars() {
        for roll in [QUARTER, 0.0] {
            let name = bar.name.clone();
            let offset = UnitQuaternion::from_euler_angles(roll, 0.0, 0.0) * Vector3::new(0.0, 0.0, 0.02);
            let bar = Object { position: offset.into(), rpy: [roll, 0.0, 0.0], ..bar.clone() };
            let world = World { objects: vec![bar], ..World::default() };
            let mut simulation =
                ArticulatedSimulator::new(gripper(), world, &[0.0; 2], Options::default()).unwrap();
            // One pad is position-controlled and the other presses.
            simulation.commands_mut()[0] =
                JointSetpoint { kp: 2e4, kd: 200.0, effort: 60.0, ..JointSetpoint::default() };
            simulation.commands_mut()[1] = JointSetpoint::effort(60.0);
            let (far, turned, _) = drift(&mut simulation, &name, 4.0);
            assert!(far < 1e-4 && turned < 1.7e-3, "{name} at {roll} rad: {far} m, {turned} rad");
        }
    }
}

#[test]
fn a_tower_of_shifted_cans_stands() {
    let can = |index: usize| Object {
        name: format!("can{index}"),
        shape: ObjectShape::Cylinder { radius: 0.05, length: 0.1 },
        mass: Some(0.5),
        position: [2.0 + 0.005 * (index % 2) as f64, 0.0, 0.05 + 0.1 * index as f64],
        ..Object::default()
    };
    let base = Object {
        name: "table".to_owned(),
        shape: ObjectShape::Box { size: [1.0, 1.0, 0.1] },
        position: [2.0, 0.0, -0.05],
        ..Object::default()
    };
    let objects: Vec<_> = (0..10).map(can).chain([base]).collect();
    let mut simulation = simulate(objects.clone());
    for _ in 0..5000 {
        simulation.step(1e-3).unwrap();
    }
    for object in &objects[..10] {
        let id = simulation.object(&object.name).unwrap();
        let moved = (simulation.object_pose(id).translation.vector - Vector3::from(object.position)).norm();
        let speed = simulation.object_velocity(id).0.norm();
        assert!(moved < 1e-4 && speed == 0.0, "{}: {moved} m, {speed} m/s", object.name);
    }
}
