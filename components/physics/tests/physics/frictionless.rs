//! Friction combine rules on every engine, measured on a sliding block.

use motorium_physics::{
    ArticulatedSimulator, Ground, JointSetpoint, Object, ObjectShape, Options, RobotSetup, Simulator, World,
};
use motorium_robots::load;
use motorium_worlds::FrictionCombine::{self, Max, Mean, Min, Multiply};

use crate::engines::{Engine, engines};

const SPEED: f64 = 1.0;

/// Speed that a block loses in 0.2 s on the ground, divided by gravity and time: the friction coefficient of
/// the contact.
fn friction(
    block: (f64, Option<FrictionCombine>),
    ground: (f64, Option<FrictionCombine>),
) -> Vec<(Engine, f64)> {
    let mut found = Vec::new();
    for engine in engines() {
        let block = Object {
            name: "block".to_owned(),
            shape: ObjectShape::Box { size: [0.4, 0.4, 0.05] },
            mass: Some(1.0),
            position: [2.0, 0.0, 0.025],
            velocity: [SPEED, 0.0, 0.0],
            friction: block.0,
            friction_combine: block.1,
            ..Object::default()
        };
        let ground = Some(Ground { friction: ground.0, friction_combine: ground.1, ..Ground::default() });
        let world = World { ground, objects: vec![block], ..World::default() };
        let model = load("panda", std::path::Path::new(".")).unwrap().model;
        let q = model.neutral();
        let mut simulation = engine.simulate(model, world, &q, Options::default());
        let id = simulation.object("block").unwrap();
        for _ in 0..200 {
            simulation.step(1e-3).unwrap();
        }
        let (linear, _) = simulation.object_velocity(id);
        found.push((engine, (SPEED - linear.x) / (9.81 * 0.2)));
    }
    found
}

#[test]
fn frictions_combine_by_the_last_rule() {
    let cases = [
        ((0.1, None), (0.5, None), 0.3),
        // Frictionless in contact with everything that has no rule.
        ((0.0, None), (0.8, None), 0.0),
        ((0.4, None), (0.0, None), 0.0),
        ((0.0, Some(Mean)), (0.8, None), 0.4),
        ((0.0, None), (0.3, Some(Max)), 0.3),
        ((0.1, Some(Min)), (0.5, None), 0.1),
        ((0.5, Some(Multiply)), (0.5, Some(Min)), 0.25),
        ((0.1, Some(Min)), (0.3, Some(Max)), 0.3),
    ];
    for (block, ground, expected) in cases {
        for (engine, found) in friction(block, ground) {
            assert!((found - expected).abs() < 0.01, "{engine:?}: {block:?} on {ground:?}: {found}");
        }
    }
}

/// The profile of the catalogue's rover gives its caster a friction of 0: a ball that rolls in a socket.
#[test]
fn the_caster_of_the_rover_rolls() {
    let loaded = load("differential-drive", std::path::Path::new(".")).unwrap();
    let mut q = loaded.model.neutral();
    q[2] = 0.033;
    let world = World { ground: Some(Ground::default()), ..World::default() };
    let setup = RobotSetup::from_loaded(&loaded).unwrap();
    let mut simulation = ArticulatedSimulator::new(setup, world, &q, Options::default()).unwrap();
    for step in 0..1000 {
        let drive = JointSetpoint { velocity: 5.0, kd: 0.05, ..JointSetpoint::default() };
        simulation.commands_mut().fill(drive);
        simulation.step(1e-3).unwrap();
        let (mut normal, mut friction) = (0.0, 0.0);
        simulation.visit_contacts(&mut |contact| {
            if [contact.first, contact.second].contains(&"caster") {
                normal += contact.force;
                friction += contact.friction.norm();
            }
        });
        assert!(step < 100 || normal > 1.0, "the caster carries {normal} N");
        assert!(friction < 1e-9, "the caster drags with {friction} N of {normal} N");
    }
}
