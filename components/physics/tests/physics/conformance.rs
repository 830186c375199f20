//! The contract of a [`Simulator`], run on every engine: commands, steps, states, contacts, rays, several
//! robots, save and restore.

use motorium_physics::{ForeignState, Ground, JointSetpoint, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::{Model, Placed, TriangleMesh, load};
use motorium_worlds::{CompoundPart, Connection, MeshCollision};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::engines::{Engine, engines};
use crate::meshes::{box_between, mesh, trough};
use crate::panda;

const DT: f64 = 1e-3;

pub(crate) fn object(name: &str, shape: ObjectShape, mass: Option<f64>, position: [f64; 3]) -> Object {
    Object {
        name: name.to_owned(),
        shape,
        mass,
        position,
        friction: 0.6,
        restitution: 0.1,
        ..Object::default()
    }
}

/// A trough of 0.18 m with two walls.
fn small_trough() -> TriangleMesh {
    TriangleMesh::clone(&trough()).scaled(&Vector3::repeat(0.3))
}

/// One object of two balls with different masses on the table.
fn club() -> Object {
    let ball = |x: f64, mass: f64| CompoundPart {
        shape: ObjectShape::Sphere { radius: 0.03 },
        position: [x, 0.0, 0.0],
        rpy: [0.0; 3],
        mass: Some(mass),
    };
    let shape = ObjectShape::Compound(vec![ball(-0.04, 0.1), ball(0.04, 0.3)]);
    object("club", shape, None, [0.5, -0.25, 0.2])
}

/// A Panda near a table with a stack of two cubes, and a ball above a tray of convex parts. Also a can, a
/// rock made of a mesh, and a club of two balls.
fn scene(engine: Engine) -> Box<dyn Simulator> {
    let cube =
        |name: &str, z: f64| object(name, ObjectShape::Box { size: [0.05; 3] }, Some(0.2), [0.5, 0.2, z]);
    let table = object("table", ObjectShape::Box { size: [0.4, 0.8, 0.1] }, None, [0.6, 0.0, 0.05]);
    let ball = object("ball", ObjectShape::Sphere { radius: 0.04 }, Some(0.1), [0.6, -0.1, 0.3]);
    let can = object("can", ObjectShape::Cylinder { radius: 0.03, length: 0.1 }, Some(0.3), [0.2, 0.02, 1.1]);
    let rock = Object {
        mass: Some(0.3),
        position: [0.66, 0.22, 0.13],
        rpy: [0.0, 0.0, 0.2],
        ..mesh("rock", box_between([0.0; 3], [0.06, 0.05, 0.04]), MeshCollision::Hull)
    };
    let tray = Object {
        mass: Some(0.8),
        position: [0.6, -0.1, 0.12],
        ..mesh("tray", small_trough(), MeshCollision::Parts(8))
    };
    let objects = vec![table, cube("lower", 0.125), cube("upper", 0.175), ball, can, rock, tray, club()];
    let world = World { ground: Some(Ground::default()), objects, ..World::default() };
    panda::at_home(engine, world, Options::default())
}

/// Swings the arm for `steps` steps and returns every bit of state along the motion.
fn swing(simulation: &mut dyn Simulator, from: u32, steps: u32) -> Vec<u64> {
    let mut bits = Vec::new();
    let commands = panda::hold(&panda::home());
    for step in from..from + steps {
        for (i, (command, hold)) in simulation.commands_mut().iter_mut().zip(&commands).enumerate() {
            let offset = [0.4, 0.3, 0.0, -0.4, 0.2, 0.3, 0.1, 0.0][i] * (4e-3 * f64::from(step)).sin();
            *command = JointSetpoint { position: hold.position + offset, ..*hold };
        }
        simulation.step(DT).unwrap_or_else(|error| panic!("step {step}: {error}"));
        let state =
            simulation.configuration().iter().chain(simulation.velocity()).chain(simulation.efforts());
        bits.extend(state.map(|x| x.to_bits()));
        for name in ["lower", "upper", "ball", "can", "rock", "tray", "club"] {
            let pose = simulation.object_pose(simulation.object(name).unwrap());
            bits.extend(
                pose.translation.vector.iter().chain(pose.rotation.coords.iter()).map(|x| x.to_bits()),
            );
        }
        simulation.visit_contacts(&mut |contact| bits.push(contact.force.to_bits()));
    }
    bits
}

#[test]
fn restored_state_continues_bit_for_bit() {
    for engine in engines() {
        let mut simulation = scene(engine);
        swing(&mut *simulation, 0, 700);
        let saved = simulation.save();
        let first = swing(&mut *simulation, 700, 500);
        simulation.restore(&saved).unwrap();
        assert!(swing(&mut *simulation, 700, 500) == first, "{engine:?}: in the simulator that saved it");
        // Another simulator of the same kind with a different history.
        let mut other = scene(engine);
        swing(&mut *other, 90, 300);
        other.restore(&saved).unwrap();
        assert!(swing(&mut *other, 700, 500) == first, "{engine:?}: in an equal simulator");
    }
}

#[test]
fn state_of_another_engine_or_world_is_rejected() {
    let all: Vec<Engine> = engines().collect();
    for (index, engine) in all.iter().copied().enumerate() {
        let other = all[(index + 1) % all.len()];
        let mut simulation = scene(engine);
        swing(&mut *simulation, 0, 10);
        let before: Vec<f64> = simulation.configuration().to_vec();
        assert_eq!(simulation.restore(&scene(other).save()), Err(ForeignState), "{engine:?}");
        let alone = panda::at_home(engine, World::default(), Options::default());
        assert_eq!(simulation.restore(&alone.save()), Err(ForeignState), "{engine:?}");
        assert_eq!(simulation.configuration(), before);
    }
}

#[test]
fn rays_hit_ground_objects_and_links() {
    for engine in engines() {
        let mut simulation = scene(engine);
        let down = -Vector3::z();
        let hit = simulation.cast_ray(Point3::new(2.0, 2.0, 1.5), down * 3.0, 5.0).unwrap();
        assert_eq!(hit.name, "ground");
        assert!((hit.distance - 1.5).abs() < 1e-9 && (hit.normal - Vector3::z()).norm() < 1e-9);
        let hit = simulation.cast_ray(Point3::new(0.5, 0.2, 0.4), down, 5.0).unwrap();
        assert_eq!(hit.name, "upper");
        assert!((hit.point.z - 0.2).abs() < 1e-9, "{engine:?}: {hit:?}");
        let hit = simulation.cast_ray(Point3::new(0.6, -1.0, 0.3), Vector3::y(), 5.0).unwrap();
        assert!(hit.name == "ball" && (hit.distance - 0.86).abs() < 1e-9, "{engine:?}: {hit:?}");
        assert!((hit.normal + Vector3::y()).norm() < 1e-9);
        assert!(simulation.cast_ray(Point3::new(0.6, -1.0, 0.3), Vector3::y(), 0.85).is_none());
        assert!(simulation.cast_ray(Point3::new(0.6, -1.0, 0.3), Vector3::zeros(), 5.0).is_none());
        // Straight at the middle of the hand, from the side.
        let hand = simulation.frame_pose(simulation.model().frame("panda_hand").unwrap());
        let middle = hand * Point3::new(0.0, 0.0, 0.033);
        let side = hand.rotation * Vector3::y();
        let hit = simulation.cast_ray(middle + side, -side, 2.0).unwrap();
        assert!(hit.name == "panda_hand" && (hit.distance - 0.898).abs() < 1e-6, "{engine:?}: {hit:?}");
        // A ray hits a moved object at its new position.
        let ball = simulation.object("ball").unwrap();
        simulation.set_object_pose(ball, Isometry3::translation(3.0, 0.0, 0.5));
        let hit = simulation.cast_ray(Point3::new(3.0, 0.0, 2.0), down, 5.0).unwrap();
        assert!(hit.name == "ball" && (hit.distance - 1.46).abs() < 1e-9, "{engine:?}: {hit:?}");
    }
}

#[test]
fn contact_forces_carry_resting_objects() {
    for engine in engines() {
        let mut simulation = scene(engine);
        panda::command_hold(&mut *simulation, &panda::home());
        for step in 0..1500 {
            simulation.step(DT).unwrap_or_else(|error| panic!("{engine:?}, step {step}: {error}"));
        }
        let mut on = std::collections::BTreeMap::<(String, String), f64>::new();
        simulation.visit_contacts(&mut |contact| {
            let pair = [contact.first, contact.second];
            let up = if pair[0] < pair[1] { contact.normal.z } else { -contact.normal.z };
            let (a, b) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            *on.entry((a.to_owned(), b.to_owned())).or_default() += contact.force * up;
        });
        let force = |a: &str, b: &str| on.get(&(a.to_owned(), b.to_owned())).copied().unwrap_or(0.0);
        // Along the normal from the first to the second name: up from lower to upper and down from lower to
        // table.
        let (upper, lower) = (force("lower", "upper"), force("lower", "table"));
        assert!((upper - 0.2 * 9.81).abs() < 0.05, "{engine:?}: {upper} N");
        assert!((lower + 0.4 * 9.81).abs() < 0.1, "{engine:?}: {lower} N");
        let top = simulation.object_pose(simulation.object("upper").unwrap()).translation.vector;
        assert!((top - Vector3::new(0.5, 0.2, 0.175)).norm() < 2e-3, "{engine:?}: the stack stands at {top}");
    }
}

#[test]
fn two_robots_in_one_world_feel_the_same_objects() {
    for engine in engines() {
        let panda = panda::loaded().model;
        let turned = Isometry3::rotation(Vector3::z() * core::f64::consts::PI);
        let places = [Isometry3::identity(), Isometry3::translation(1.4, 0.0, 0.0) * turned];
        let placed: Vec<_> = ["one/", "two/"]
            .into_iter()
            .zip(places)
            .map(|(prefix, placement)| Placed { model: &panda, prefix, placement })
            .collect();
        let both = Model::world("both", &placed).unwrap();
        let home = panda::home();
        let q = [home.clone(), home.clone()].concat();
        let mut simulation = engine.simulate(both, World::default(), &q, Options::default());
        let hold = panda::hold(&home);
        for (command, hold) in simulation.commands_mut().iter_mut().zip(hold.iter().chain(&hold)) {
            *command = *hold;
        }
        (0..300).for_each(|_| _ = simulation.step(DT).unwrap());
        let (one, two) = simulation.positions().split_at(home.len());
        // The two are mirror images, so their joints agree.
        for (one, two) in one.iter().zip(two) {
            assert!((one - two).abs() < 1e-9, "{engine:?}: {one} and {two}");
        }
    }
}

#[test]
fn floating_base_and_allocation_flags_match_the_engine() {
    for engine in engines() {
        let simulation = scene(engine);
        assert_eq!(simulation.capabilities().allocation_free, engine != Engine::Rapier);
        let free = crate::legged::body(r#"<sphere radius="0.1"/>"#);
        let q = free.neutral();
        let floats = match engine {
            Engine::Articulated => {
                motorium_physics::ArticulatedSimulator::new(free, World::default(), &q, Options::default())
                    .is_ok()
            }
            Engine::Rapier => {
                motorium_physics::RapierSimulator::new(free, World::default(), &q, Options::default()).is_ok()
            }
            Engine::Mujoco => {
                motorium_physics::MujocoSimulator::new(free, World::default(), &q, Options::default()).is_ok()
            }
        };
        assert_eq!(simulation.capabilities().floating_bases, floats, "{engine:?}");
    }
}

/// A world of one object, with a change applied.
fn with(change: impl FnOnce(&mut World)) -> World {
    let cube = object("cube", ObjectShape::Box { size: [0.1; 3] }, Some(1.0), [0.0, 0.0, 5.0]);
    let mut world = World { ground: Some(Ground::default()), objects: vec![cube], ..World::default() };
    change(&mut world);
    world
}

#[test]
fn engine_capabilities_match_what_is_simulated() {
    use motorium_physics::{Capabilities, Integrator};
    use motorium_worlds::{Conveyor, Softness};
    type Flag = fn(&Capabilities) -> bool;
    let table = || mesh("hall", box_between([-1.0; 3], [1.0, 1.0, 0.0]), MeshCollision::Triangles);
    let connection = Connection {
        parts: ["cube".to_owned(), "world".to_owned()],
        kind: Default::default(),
        point: [0.0; 3],
    };
    let soft = Softness { stiffness: 1e4, damping: 10.0 };
    let rows: Vec<(&str, Flag, World, Options)> = vec![
        (
            "rolling",
            |can| can.rolling_friction,
            with(|w| w.objects[0].rolling_friction = 1e-3),
            Options::default(),
        ),
        (
            "torsional",
            |can| can.rolling_friction,
            with(|w| w.objects[0].torsional_friction = 1e-3),
            Options::default(),
        ),
        (
            "conveyors",
            |can| can.conveyors,
            with(|w| w.objects[0].conveyor = Some(Conveyor { velocity: [1.0, 0.0, 0.0] })),
            Options::default(),
        ),
        ("textures", |can| can.textures, with(|w| w.objects[0].soft = Some(soft)), Options::default()),
        ("triangles", |can| can.triangles, with(|w| w.objects.push(table())), Options::default()),
        ("connections", |can| can.connections, with(|w| w.connections.push(connection)), Options::default()),
        (
            "integrators",
            |can| can.integrators,
            with(|_| {}),
            Options { integrator: Integrator::Midpoint, ..Options::default() },
        ),
    ];
    for engine in engines() {
        let can = scene(engine).capabilities();
        for (name, flag, world, options) in &rows {
            let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
            let built = engine.try_simulate(pendulum, world.clone(), &[0.0], *options);
            assert_eq!(built.is_ok(), flag(&can), "{engine:?}, {name}");
            if let Ok(mut simulation) = built {
                (0..20).for_each(|_| _ = simulation.step(DT).unwrap());
            }
        }
    }
}

#[test]
fn rays_and_contacts_name_meshes_and_compounds() {
    for engine in engines() {
        let mut simulation = scene(engine);
        panda::command_hold(&mut *simulation, &panda::home());
        for step in 0..2000 {
            simulation.step(DT).unwrap_or_else(|error| panic!("{engine:?}, step {step}: {error}"));
        }
        // Average over a while, because spring contacts oscillate.
        let mut up = std::collections::BTreeMap::<String, f64>::new();
        for _ in 0..400 {
            simulation.step(DT).unwrap();
            simulation.visit_contacts(&mut |contact| {
                for (name, sign) in [(contact.second, 1.0), (contact.first, -1.0)] {
                    *up.entry(name.to_owned()).or_default() +=
                        sign * contact.force * contact.normal.z / 400.0;
                }
            });
        }
        // The ball is in the tray, which supports it.
        for (name, weight) in [("rock", 0.3), ("club", 0.4), ("tray", 0.8)] {
            let found = up.get(name).copied().unwrap_or(0.0);
            let id = simulation.object(name).unwrap();
            let at = simulation.object_pose(id).translation.vector;
            assert!(
                (found - weight * 9.81).abs() < 0.05 * 9.81,
                "{engine:?}: {name} at {at} is carried with {found} N"
            );
            let (linear, angular) = simulation.object_velocity(id);
            assert!(
                linear.norm() < 5e-3 && angular.norm() < 0.2,
                "{engine:?}: {name} at {at}: {linear} m/s, {angular} rad/s"
            );
        }
        // A ray through the heavier ball of the club.
        let club = simulation.object_pose(simulation.object("club").unwrap());
        let heavy = club * Point3::new(0.04, 0.0, 0.0);
        let hit = simulation.cast_ray(heavy + Vector3::z(), -Vector3::z(), 2.0).unwrap();
        assert!(hit.name == "club" && (hit.distance - 0.97).abs() < 1e-9, "{engine:?}: {hit:?}");
    }
}
