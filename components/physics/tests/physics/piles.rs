//! Large piles: islands with more contact points than a matrix is formed for.

use motorium_physics::{ArticulatedSimulator, Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::load;
use nalgebra::{Isometry3, Vector3};

/// A level box of 0.5 kg with sides of 0.1 m, at `position` \[m\].
pub(crate) fn cube(name: &str, position: [f64; 3]) -> Object {
    Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass: Some(0.5),
        position,
        friction: 0.6,
        ..Object::default()
    }
}

/// Objects on the ground, with a pendulum hanging far away.
pub(crate) fn scene(objects: Vec<Object>) -> ArticulatedSimulator {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0));
    let world = World { ground: Some(Ground::default()), objects, ..World::default() };
    ArticulatedSimulator::new(pendulum, world, &[0.0], Options::default()).unwrap()
}

/// Force of the ground, upwards \[N\].
pub(crate) fn of_ground(simulation: &ArticulatedSimulator) -> f64 {
    let mut sum = 0.0;
    simulation.visit_contacts(&mut |contact| {
        if contact.first == "ground" {
            sum += contact.force * contact.normal.z;
        } else if contact.second == "ground" {
            sum -= contact.force * contact.normal.z;
        }
    });
    sum
}

#[test]
fn a_wall_of_many_contacts_stands_on_the_ground() {
    // Bricks in a bond: one island of about two hundred points.
    let mut objects = Vec::new();
    for row in 0..5 {
        for column in 0..6 {
            let x = 0.1001 * f64::from(column) + if row % 2 == 0 { 0.0 } else { 0.05 };
            objects.push(cube(&format!("brick{row}{column}"), [x, 0.0, 0.05 + 0.1 * f64::from(row)]));
        }
    }
    let starts: Vec<_> = objects.iter().map(|object| (object.name.clone(), object.position)).collect();
    let mut simulation = scene(objects);
    let mut mean = 0.0;
    for step in 0..400 {
        simulation.step(1e-3).unwrap_or_else(|error| panic!("step {step}: {error}"));
        if step >= 200 {
            mean += of_ground(&simulation) / 200.0;
        }
    }
    let mut points = 0;
    simulation.visit_contacts(&mut |contact| {
        points += 1;
        let slip = contact.friction.norm() - 0.6 * contact.force;
        // the ground has a friction of 0.8, the bricks 0.6
        assert!(slip < 0.1 * contact.force + 1e-6, "{contact:?}");
        assert!(contact.depth < 5e-4, "{contact:?}");
    });
    assert!(points > 100, "{points} points");
    let weight = 30.0 * 0.5 * 9.81;
    assert!((mean - weight).abs() < 0.01 * weight, "{mean} N, {weight} N");
    for (name, start) in starts {
        let at = simulation.object_pose(simulation.object(&name).unwrap()).translation.vector;
        assert!((at - Vector3::from(start)).norm() < 2e-3, "{name} at {at}");
    }
}

/// State of a box dropped on the ground, with a pendulum hanging `above` it \[m\], after half a second.
fn dropped(contact_iterations: usize, above: f64) -> [u64; 3] {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 1.1 + above));
    let tilted = Object { rpy: [0.3, 0.2, 0.0], ..cube("box", [0.0, 0.0, 0.2]) };
    let world = World { ground: Some(Ground::default()), objects: vec![tilted], ..World::default() };
    let options = Options { contact_iterations, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum, world, &[0.0], options).unwrap();
    (0..500).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let place = simulation.object_pose(simulation.object("box").unwrap()).translation.vector;
    [place.x, place.y, place.z].map(f64::to_bits)
}

#[test]
fn grasp_steps_apply_near_a_robot_only() {
    assert_eq!(dropped(1, 30.0), dropped(4, 30.0));
    // The end of the rod starts half a centimetre above the box.
    assert_ne!(dropped(1, 0.162), dropped(4, 0.162));
}
