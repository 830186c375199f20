//! Allocations of a step after the first contact, limit and command.

use motorium::telemetry::{allocations, counts_allocations, set_apart};
use motorium_physics::{
    ArticulatedSimulator, Conveyor, Ground, Object, ObjectShape, Options, RapierSimulator, Simulator, World,
};

use motorium_robots::Kinematics;

use crate::panda;

const DT: f64 = 1e-3;

/// Heap allocations of 1000 steps after a warm-up of 2000, with the arm swinging about home.
fn steady(simulation: &mut dyn Simulator) -> u64 {
    assert!(counts_allocations());
    let commands = panda::hold(&panda::home());
    let mut swing = |steps: std::ops::Range<u32>| {
        for step in steps {
            let offset = 0.15 * (f64::from(step) * 8.0 * DT).sin();
            for (command, hold) in simulation.commands_mut().iter_mut().zip(&commands) {
                *command = *hold;
                command.position += offset;
            }
            simulation.step(DT).unwrap();
        }
    };
    swing(0..2000);
    let before = allocations().own;
    swing(2000..3000);
    allocations().own - before
}

fn articulated(world: World) -> u64 {
    let (model, home) = (panda::loaded().model, panda::home());
    steady(&mut ArticulatedSimulator::new(model, world, &home, Options::default()).unwrap())
}

fn grounded(objects: Vec<Object>) -> World {
    World { ground: Some(Ground::default()), objects, ..World::default() }
}

fn cube(name: &str, mass: Option<f64>, x: f64) -> Object {
    Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass,
        position: [x, 0.5, 0.05],
        ..Object::default()
    }
}

#[test]
fn an_arm_in_free_motion_allocates_nothing() {
    assert_eq!(articulated(World::default()), 0);
    assert_eq!(articulated(grounded(vec![cube("fixed", None, 1.0)])), 0);
}

#[test]
fn an_arm_beside_objects_at_rest_allocates_nothing() {
    assert_eq!(articulated(grounded(vec![cube("one", Some(0.5), 1.0), cube("two", Some(0.5), 1.2)])), 0);
}

#[test]
fn objects_rolling_on_a_belt_in_wind_allocate_nothing() {
    let ball = Object {
        shape: ObjectShape::Sphere { radius: 0.05 },
        rolling_friction: 1e-3,
        torsional_friction: 1e-3,
        drag: 0.01,
        ..cube("ball", Some(0.5), 1.0)
    };
    let belt = Some(Conveyor { velocity: [0.2, 0.1, 0.0] });
    let ground = Some(Ground { rolling_friction: 1e-3, conveyor: belt, ..Ground::default() });
    let objects = vec![ball, cube("parcel", Some(0.5), 1.4)];
    assert_eq!(articulated(World { ground, objects, wind: [0.0, 3.0, 0.0], ..World::default() }), 0);
}

#[test]
fn an_arm_that_hits_objects_allocates_nothing() {
    // A cube on a pillar between the fingers; the swinging hand knocks it off.
    let (model, home) = (panda::loaded().model, panda::home());
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &home);
    let hand = kinematics.pose(&model, model.frame("panda_hand_tcp").unwrap()).translation.vector;
    let height = hand.z - 0.02;
    let pillar =
        Object { shape: ObjectShape::Box { size: [0.03, 0.03, height] }, ..cube("pillar", None, 0.0) };
    let pillar = Object { position: [hand.x, hand.y, 0.5 * height], ..pillar };
    let small = Object { shape: ObjectShape::Box { size: [0.04; 3] }, ..cube("cube", Some(0.1), 0.0) };
    let small = Object { position: hand.into(), ..small };
    let world = grounded(vec![pillar, small]);
    let mut simulation = ArticulatedSimulator::new(model, world, &home, Options::default()).unwrap();
    assert_eq!(steady(&mut simulation), 0);
    let place = simulation.object_pose(simulation.object("cube").unwrap()).translation.vector;
    assert!((place - hand).norm() > 0.02, "{place}");
}

#[test]
fn rapier_allocations_are_counted_separately() {
    for contact_iterations in [1, 2, 4] {
        let options = Options { contact_iterations, ..Options::default() };
        let (model, home) = (panda::loaded().model, panda::home());
        let mut simulation = RapierSimulator::new(model, grounded(vec![]), &home, options).unwrap();
        simulation.enclose_rapier(|call| set_apart(call));
        let apart = allocations().set_apart;
        assert_eq!(steady(&mut simulation), 0);
        let per_step = (allocations().set_apart - apart) as f64 / 3000.0;
        println!("{contact_iterations} iterations: rapier allocates {per_step:.1} times a step");
        assert!(per_step > 0.0, "rapier has stopped allocating: say so in the documentation");
    }
}
