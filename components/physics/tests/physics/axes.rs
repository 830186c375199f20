//! Joint axes as CAD exporters write them: almost, but not exactly, along a coordinate axis.

use motorium_physics::{JointSetpoint, Options, World};
use motorium_robots::{MimicMode, Model, PackagePath, parse_urdf};

use crate::engines::engines;

/// A rod that extends sideways from a horizontal hinge. The joint frame is rotated so that its z axis is the
/// world's y axis.
fn rod(axis: &str) -> Model {
    let urdf = format!(
        r#"<robot name="rod"><link name="wall"/><link name="rod"><inertial><origin xyz="0.3 0 0"/><mass value="1.5"/>
        <inertia ixx="0.001" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="revolute"><origin xyz="0 0 1" rpy="-1.5707963267948966 0 0"/><parent link="wall"/>
        <child link="rod"/><axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="10" effort="100"/></joint></robot>"#
    );
    parse_urdf(&urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn axis_near_minus_z_rotates_equally_on_every_engine() {
    for engine in engines() {
        let fall = |axis: &str| {
            let mut simulation = engine.simulate(rod(axis), World::default(), &[0.0], Options::default());
            simulation.commands_mut().fill(JointSetpoint::default());
            (0..300).for_each(|_| _ = simulation.step(1e-3).unwrap());
            simulation.positions()[0]
        };
        // Gravity turns the rod down, about +y of the world: positively about +z of the joint, negatively
        // about -z.
        let (up, down) = (fall("0 0 1"), fall("0 0 -1"));
        assert!(up > 0.4 && (up + down).abs() < 1e-9, "{engine:?}: {up} {down}");
        for tilted in ["0 1.22465e-16 -1", "1e-17 0 -1", "-3e-15 2e-15 -1", "0 1e-12 -1"] {
            let found = fall(tilted);
            assert!((found - down).abs() < 1e-9, "{engine:?}, axis {tilted}: {found}, expected {down}");
        }
    }
}

#[test]
fn contact_solver_handles_an_axis_near_minus_z() {
    // The rod's end lands on a shelf, with the same contact for both forms of the axis.
    for axis in ["0 0 -1", "0 1.22465e-16 -1"] {
        let urdf = r#"<collision><origin xyz="0.6 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
            <joint name="hinge""#;
        let text = format!(
            r#"<robot name="rod"><link name="wall"/><link name="rod"><inertial><origin xyz="0.3 0 0"/><mass value="1.5"/>
            <inertia ixx="0.001" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>{urdf}
            type="revolute"><origin xyz="0 0 0.5" rpy="-1.5707963267948966 0 0"/><parent link="wall"/>
            <child link="rod"/><axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="10" effort="100"/></joint></robot>"#
        );
        let model = parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
        for engine in engines() {
            let world = World { ground: Some(motorium_physics::Ground::default()), ..World::default() };
            let mut simulation = engine.simulate(model.clone(), world, &[0.0], Options::default());
            (0..2000).for_each(|_| _ = simulation.step(1e-3).unwrap());
            // Its centre at height 0.05: 0.5 - 0.6 sin(angle) = 0.05.
            let expected = -(0.45_f64 / 0.6).asin();
            let found = simulation.positions()[0];
            assert!((found - expected).abs() < 2e-3, "{engine:?}, axis {axis}: {found}, expected {expected}");
            assert!(simulation.touching("rod", "ground"));
        }
    }
}
