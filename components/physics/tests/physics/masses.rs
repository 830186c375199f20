//! Objects rest regardless of their mass and of distant robots in the world.

use motorium_physics::{
    ArticulatedSimulator, BuildError, Ground, Object, ObjectShape, Options, RapierSimulator, Simulator, World,
};
use motorium_robots::{MimicMode, Model, PackagePath, load, parse_urdf};

/// An arm of one joint whose moving link has this mass \[kg\]; without inertia if the mass is zero.
fn panner(mass: f64) -> Model {
    let moment = mass * 1e-3;
    let inertial = format!(
        r#"<inertial><mass value="{mass}"/><inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>"#
    );
    let inertial = if mass > 0.0 { inertial } else { String::new() };
    let text = format!(
        r#"<robot name="panner"><link name="base"/><link name="head">{inertial}
  <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="pan" type="continuous"><parent link="base"/><child link="head"/><origin xyz="0 0 3"/>
  <axis xyz="0 0 1"/><limit effort="10" velocity="10"/></joint></robot>"#
    );
    parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

fn world(mass: f64) -> World {
    let object = |name: &str, mass, position| Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.2; 3] },
        mass: Some(mass),
        position,
        ..Object::default()
    };
    // Two on the ground, one of which carries a third.
    let objects = vec![
        object("alone", mass, [1.0, 0.0, 0.1]),
        object("lower", mass, [-1.0, 0.0, 0.1]),
        object("upper", mass, [-1.0, 0.0, 0.3]),
    ];
    World { ground: Some(Ground::default()), objects, ..World::default() }
}

/// Largest distance of an object from its start after a second \[m\].
fn sinks(simulation: &mut dyn Simulator, expected: &World) -> f64 {
    for _ in 0..1000 {
        simulation.step(1e-3).unwrap();
    }
    let moved = expected.objects.iter().map(|object| {
        let id = simulation.object(&object.name).unwrap();
        (simulation.object_pose(id).translation.vector - nalgebra::Vector3::from(object.position)).norm()
    });
    moved.fold(0.0, f64::max)
}

#[test]
fn objects_of_all_masses_rest_beside_robots_of_all_masses() {
    for robot in [0.0, 1e-6, 1e-3, 1.0, 1e3] {
        for mass in [1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9] {
            let (world, options) = (world(mass), Options { armature: 0.1, ..Options::default() });
            let mut simulation =
                ArticulatedSimulator::new(panner(robot), world.clone(), &[0.0], options).unwrap();
            let moved = sinks(&mut simulation, &world);
            assert!(moved < 1e-6, "robot of {robot} kg, objects of {mass} kg: {moved} m");
        }
    }
}

#[test]
fn a_plate_on_rollers_sinks_no_deeper_beside_a_light_robot() {
    let depth = |robot: Model| {
        let q = robot.neutral();
        let roller = |name: &str, x: f64| Object {
            name: name.to_owned(),
            shape: ObjectShape::Box { size: [0.05, 0.3, 0.1] },
            position: [x, 0.0, 0.05],
            ..Object::default()
        };
        let plate = Object {
            name: "plate".to_owned(),
            shape: ObjectShape::Box { size: [0.5, 0.2, 0.02] },
            mass: Some(20.0),
            position: [0.0, 0.0, 0.11],
            ..Object::default()
        };
        let objects = vec![roller("one", -0.2), roller("two", 0.2), plate];
        let world = World { objects, ..World::default() };
        let mut simulation = ArticulatedSimulator::new(robot, world, &q, Options::default()).unwrap();
        for _ in 0..1000 {
            simulation.step(1e-3).unwrap();
        }
        0.11 - simulation.object_pose(simulation.object("plate").unwrap()).translation.z
    };
    let heavy = depth(panner(10.0));
    for mass in [1e-6, 1e-3, 0.028] {
        assert!((depth(panner(mass)) - heavy).abs() < 1e-12, "{mass} kg: {}, {heavy}", depth(panner(mass)));
    }
}

/// The engine would let it fall through the ground.
#[test]
fn rapier_rejects_bodies_it_cannot_support() {
    let robot = || load("panda", std::path::Path::new(".")).unwrap().model;
    let q = load("panda", std::path::Path::new(".")).unwrap().model.neutral();
    let build = |mass| RapierSimulator::new(robot(), world(mass), &q, Options::default());
    match build(2.1e4).map(|_| ()) {
        Err(BuildError::Unable { engine: "rapier", owner, .. }) => assert_eq!(owner, "alone"),
        other => panic!("{other:?}"),
    }
    for mass in [1e-6, 1e-3, 1.0, 1e3, 2.0e4] {
        let world = world(mass);
        let moved = sinks(&mut build(mass).unwrap(), &world);
        assert!(moved < 2e-3, "{mass} kg: {moved} m");
    }
}
