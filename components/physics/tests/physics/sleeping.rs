//! Objects at rest sleep, support others, and wake when something reaches them; also in large piles.

use motorium_physics::{ArticulatedSimulator, Ground, Object, Options, Simulator, World};
use motorium_robots::load;
use nalgebra::{Isometry3, Vector3};

use crate::piles::{cube, of_ground, scene};

fn tower(height: usize) -> Vec<Object> {
    (0..height).map(|k| cube(&format!("box{k}"), [0.0, 0.0, 0.05 + 0.1 * k as f64])).collect()
}

fn run(simulation: &mut ArticulatedSimulator, steps: usize) {
    for step in 0..steps {
        simulation.step(1e-3).unwrap_or_else(|error| panic!("step {step}: {error}"));
    }
}

/// Velocities and poses of all objects, to the bit.
fn bits(simulation: &ArticulatedSimulator, names: &[&str]) -> Vec<u64> {
    let of = |name: &&str| {
        let id = simulation.object(name).unwrap();
        let (pose, (linear, angular)) = (simulation.object_pose(id), simulation.object_velocity(id));
        let numbers: Vec<f64> = linear
            .iter()
            .chain(&angular)
            .chain(&pose.translation.vector)
            .chain(&pose.rotation.coords)
            .copied()
            .collect();
        numbers.into_iter().map(f64::to_bits)
    };
    names.iter().flat_map(of).collect()
}

fn sleeps(simulation: &ArticulatedSimulator, name: &str) -> bool {
    let (linear, angular) = simulation.object_velocity(simulation.object(name).unwrap());
    linear == Vector3::zeros() && angular == Vector3::zeros()
}

#[test]
fn a_standing_tower_sleeps_and_bears_its_weight() {
    let mut simulation = scene(tower(3));
    run(&mut simulation, 2000);
    let names = ["box0", "box1", "box2"];
    assert!(names.iter().all(|name| sleeps(&simulation, name)), "they do not sleep");
    let before = bits(&simulation, &names);
    for _ in 0..200 {
        run(&mut simulation, 1);
        let force = of_ground(&simulation);
        assert!((force - 1.5 * 9.81).abs() < 0.02, "{force} N");
        assert!(simulation.touching("box0", "box1") && simulation.touching("box1", "box2"));
    }
    assert_eq!(bits(&simulation, &names), before);
}

#[test]
fn sleepers_wake_by_impact_lost_support_or_gravity() {
    let mut objects = tower(2);
    objects.push(cube("far", [5.0, 0.0, 0.05]));
    objects.push(cube("ball", [0.03, 0.0, 30.0]));
    let mut simulation = scene(objects);
    run(&mut simulation, 1500);
    assert!(sleeps(&simulation, "box0") && sleeps(&simulation, "box1") && sleeps(&simulation, "far"));
    let asleep = bits(&simulation, &["far"]);
    let mut woken = 0;
    for _ in 0..1500 {
        run(&mut simulation, 1);
        woken += usize::from(!sleeps(&simulation, "box1"));
    }
    assert!(woken > 10, "the cube that falls wakes the tower: {woken} steps");
    assert_eq!(bits(&simulation, &["far"]), asleep, "and nothing else");

    let mut simulation = scene(tower(3));
    run(&mut simulation, 2000);
    assert!(sleeps(&simulation, "box2"));
    let lowest = simulation.object("box0").unwrap();
    simulation.set_object_pose(lowest, Isometry3::translation(3.0, 0.0, 0.05));
    run(&mut simulation, 1000);
    let height = simulation.object_pose(simulation.object("box2").unwrap()).translation.z;
    assert!((height - 0.15).abs() < 2e-3, "the cube above the removed one falls: {height} m");

    simulation.set_gravity(Vector3::new(0.0, 0.0, 1.0));
    run(&mut simulation, 1000);
    let height = simulation.object_pose(simulation.object("box2").unwrap()).translation.z;
    assert!((height - 0.65).abs() < 0.01, "half a metre up in a second: {height} m");
}

#[test]
fn state_saved_asleep_wakes_bit_for_bit() {
    let mut objects = tower(2);
    objects.push(cube("ball", [0.03, 0.0, 20.0]));
    let names = ["box0", "box1", "ball"];
    let mut simulation = scene(objects.clone());
    run(&mut simulation, 1500);
    assert!(sleeps(&simulation, "box1"));
    let saved = simulation.save();
    run(&mut simulation, 1200);
    let expected = bits(&simulation, &names);
    simulation.restore(&saved).unwrap();
    run(&mut simulation, 1200);
    assert_eq!(bits(&simulation, &names), expected);
    let mut other = scene(objects);
    run(&mut other, 300);
    other.restore(&saved).unwrap();
    assert!((of_ground(&other) - 9.81).abs() < 0.02);
    run(&mut other, 1200);
    assert_eq!(bits(&other, &names), expected, "in another simulator");
}

/// Speed along x after a second of a frictionless box under a very small gravity along x.
fn crept(sleeping: bool) -> f64 {
    let ground = Ground { friction: 0.0, ..Ground::default() };
    let objects = vec![Object { friction: 0.0, ..cube("box", [0.0, 0.0, 0.05]) }];
    let world = World { ground: Some(ground), objects, gravity: [5e-5, 0.0, -9.81], ..World::default() };
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0));
    let options = Options { sleeping, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum, world, &[0.0], options).unwrap();
    run(&mut simulation, 1000);
    simulation.object_velocity(simulation.object("box").unwrap()).0.x
}

#[test]
fn sleepers_on_a_slope_slide_when_friction_falls() {
    let objects = vec![cube("box", [0.0, 0.0, 0.05])];
    let gravity = [2.0, 0.0, -9.6];
    let world = World { ground: Some(Ground::default()), objects, gravity, ..World::default() };
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0));
    let mut simulation = ArticulatedSimulator::new(pendulum, world, &[0.0], Options::default()).unwrap();
    run(&mut simulation, 1500);
    assert!(sleeps(&simulation, "box"));
    let mut properties = simulation.properties();
    simulation.change(&properties).unwrap();
    run(&mut simulation, 1);
    assert!(sleeps(&simulation, "box"), "the same friction lets it sleep");
    properties.surfaces.iter_mut().for_each(|surface| surface.friction = 0.1);
    simulation.change(&properties).unwrap();
    run(&mut simulation, 500);
    let speed = simulation.object_velocity(simulation.object("box").unwrap()).0.x;
    let expected = 0.5 * (2.0 - 0.1 * 9.6);
    assert!((speed - expected).abs() < 0.01 * expected, "{speed} m/s, expected {expected} m/s");
}

#[test]
fn slow_object_keeps_moving_without_sleeping() {
    assert_eq!(crept(true), 0.0);
    let speed = crept(false);
    assert!((speed - 5e-5).abs() < 2e-6, "{speed} m/s after a second at 5e-5 m/s2");
}

#[test]
fn a_distant_contact_changes_no_bit_of_a_free_robot() {
    let swing = |objects: Vec<Object>| {
        let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
        let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0));
        let world = World { ground: Some(Ground::default()), objects, ..World::default() };
        let mut simulation = ArticulatedSimulator::new(pendulum, world, &[0.7], Options::default()).unwrap();
        run(&mut simulation, 700);
        let velocity = simulation.object("box0").map(|id| simulation.object_velocity(id).0.norm());
        (simulation.positions()[0].to_bits(), simulation.velocities()[0].to_bits(), velocity)
    };
    let (alone, _, none) = swing(Vec::new());
    // A tower dropped from two centimetres reaches the ground in the meantime.
    let falling = tower(3).into_iter().map(|mut object| {
        object.position[2] += 0.02;
        object
    });
    let (beside, _, some) = swing(falling.collect());
    assert_eq!(alone, beside);
    assert!(none.is_none() && some.is_some_and(|speed| speed < 0.05), "{some:?}");
}
