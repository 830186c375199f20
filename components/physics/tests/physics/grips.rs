//! Grippers that hold bodies of every shape still, between pads wider and narrower than the bodies.

use motorium_physics::{ArticulatedSimulator, JointSetpoint, Object, Options, Simulator, World};
use motorium_robots::{MimicMode, Model, PackagePath, parse_urdf};
use nalgebra::Vector3;

use crate::pairs::{Body, DRIFT, ROTATION, bodies, drift};

/// A gripper with two pads of this URDF geometry that press along x. Their inner sides are at x = -0.1 and x
/// = 0.1 m.
fn gripper(geometry: &str, rpy: &str, depth: f64) -> Model {
    let pad = |name: &str, x: f64, axis: f64| {
        format!(
            r#"<link name="{name}"><inertial><mass value="0.2"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="{} 0 0" rpy="{rpy}"/><geometry><{geometry}/></geometry></collision></link>
  <joint name="{name}_joint" type="prismatic"><parent link="base"/><child link="{name}"/><origin xyz="{x} 0 0"/><axis xyz="{axis} 0 0"/>
  <limit lower="-0.1" upper="0.1" effort="200" velocity="2"/></joint>"#,
            -depth * axis
        )
    };
    let (left, right) = (pad("left", -0.1, 1.0), pad("right", 0.1, -1.0));
    let text = format!(r#"<robot name="gripper"><link name="base"/>{left}{right}</robot>"#);
    parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn grippers_hold_every_shape_between_pads_of_every_shape() {
    let pads = [
        ("box size=\"0.02 0.06 0.06\"", "0 0 0", 0.01),
        ("box size=\"0.02 0.01 0.06\"", "0 0 0", 0.01),
        ("box size=\"0.02 0.06 0.01\"", "0 0 0", 0.01),
        ("cylinder radius=\"0.03\" length=\"0.02\"", "0 1.5707963267948966 0", 0.01),
        ("cylinder radius=\"0.02\" length=\"0.06\"", "0 0 0", 0.02),
        ("capsule radius=\"0.02\" length=\"0.04\"", "0 0 0", 0.02),
        ("cylinder radius=\"0.02\" length=\"0.06\"", "1.5707963267948966 0 0", 0.02),
    ];
    let mut failures = Vec::new();
    for (geometry, rpy, depth) in pads {
        for Body { object, height, .. } in bodies() {
            // An object that stands or lies on a face of `height` is held between two of these.
            let turned = nalgebra::UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0)
                * nalgebra::UnitQuaternion::from_euler_angles(object.rpy[0], object.rpy[1], object.rpy[2]);
            // A flat pad transmits the moment of the off-centre weight.
            let flat = geometry.starts_with("box") && object.name != "sphere";
            let (name, beside) = (object.name.clone(), if flat { 0.003 } else { 0.0 });
            let held = Object { position: [0.0, beside, -0.01], rpy: turned.euler_angles().into(), ..object };
            let world = World { objects: vec![held], ..World::default() };
            let closed = 0.1 - height;
            let mut simulation = ArticulatedSimulator::new(
                gripper(geometry, rpy, depth),
                world,
                &[closed; 2],
                Options::default(),
            )
            .unwrap();
            // One pad is position-controlled and the other presses.
            simulation.commands_mut()[0] =
                JointSetpoint { kp: 2e4, kd: 200.0, effort: 60.0, ..JointSetpoint::hold(closed, 2e4, 200.0) };
            simulation.commands_mut()[1] = JointSetpoint::effort(60.0);
            let (far, angle, _) = drift(&mut simulation, &name, [0.5, 2.0]);
            let mut holds = Vector3::zeros();
            simulation.visit_contacts(&mut |contact| holds += contact.normal.abs() * contact.force);
            if far > DRIFT || angle > ROTATION || holds.x < 100.0 {
                let angle = angle.to_degrees();
                failures.push(format!("{name} in {geometry} {rpy}: {:.4} mm, {angle:.4} degrees", far * 1e3));
            }
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}
