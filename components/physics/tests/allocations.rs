//! What a step allocates once everything has happened once.

mod panda;

use motorium::telemetry::{CountingAllocator, allocations, counts_allocations, set_apart};
use motorium_physics::{Contacts, Ground, Object, ObjectShape, Options, Rapier, Simulator, World};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const DT: f64 = 1e-3;

/// Heap allocations of 1000 steps after 2000 others, the arm swinging about home.
fn steady(world: World, options: Options) -> u64 {
    assert!(counts_allocations());
    let home = panda::home();
    let mut simulation = panda::at_home(world, options);
    simulation.enclose_rapier(|call| set_apart(call));
    let commands = panda::hold(&home);
    let swing = |simulation: &mut Rapier, steps: std::ops::Range<u32>| {
        for step in steps {
            let offset = 0.15 * (f64::from(step) * 8.0 * DT).sin();
            for (command, hold) in simulation.commands_mut().iter_mut().zip(&commands) {
                *command = *hold;
                command.position += offset;
            }
            simulation.step(DT).unwrap();
        }
    };
    swing(&mut simulation, 0..2000);
    let before = allocations().own;
    swing(&mut simulation, 2000..3000);
    allocations().own - before
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
        rpy: [0.0; 3],
        friction: 0.8,
        restitution: 0.0,
    }
}

#[test]
fn an_arm_in_free_motion_allocates_nothing() {
    assert_eq!(steady(World::default(), Options::default()), 0);
    assert_eq!(steady(grounded(vec![cube("fixed", None, 1.0)]), Options::default()), 0);
}

#[test]
fn objects_that_have_come_to_rest_allocate_nothing() {
    let objects = vec![cube("one", Some(0.5), 1.0), cube("two", Some(0.5), 1.2)];
    assert_eq!(steady(grounded(objects), Options::default()), 0);
}

#[test]
fn all_that_is_allocated_near_contacts_is_rapiers_and_can_be_seen_apart() {
    for contact_iterations in [1, 2, 4] {
        let options = Options { contacts: Contacts::Always, contact_iterations, ..Options::default() };
        let apart = allocations().set_apart;
        assert_eq!(steady(grounded(vec![]), options), 0);
        let per_step = (allocations().set_apart - apart) as f64 / 3000.0;
        println!("{contact_iterations} iterations: rapier allocates {per_step:.1} times a step");
        assert!(per_step > 0.0, "rapier has stopped allocating: say so in the documentation");
    }
}
