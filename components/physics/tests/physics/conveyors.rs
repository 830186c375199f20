//! Conveyor surfaces, and the wind, against closed forms.

use motorium_physics::{Conveyor, Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::load;
use nalgebra::Vector3;

use crate::engines::{Engine, engines};

const G: f64 = 9.81;

fn simulate(engine: Engine, world: World) -> Box<dyn Simulator> {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&nalgebra::Isometry3::translation(0.0, 0.0, 50.0));
    engine.simulate(pendulum, world, &[0.0], Options::default())
}

fn run(simulation: &mut dyn Simulator, seconds: f64) {
    (0..(seconds * 1e3).round() as usize).for_each(|_| _ = simulation.step(1e-3).unwrap());
}

fn velocity(simulation: &dyn Simulator, object: &str) -> Vector3<f64> {
    simulation.object_velocity(simulation.object(object).unwrap()).0
}

fn position(simulation: &dyn Simulator, object: &str) -> Vector3<f64> {
    simulation.object_pose(simulation.object(object).unwrap()).translation.vector
}

/// A belt of four metres that runs along its x axis at `speed` \[m/s\], rotated by `yaw`, with its top at 0.1
/// m.
fn belt(speed: f64, yaw: f64) -> Object {
    Object {
        name: "belt".to_owned(),
        shape: ObjectShape::Box { size: [4.0, 0.4, 0.1] },
        position: [0.0, 0.0, 0.05],
        rpy: [0.0, 0.0, yaw],
        friction: 0.4,
        conveyor: Some(Conveyor { velocity: [speed, 0.0, 0.0] }),
        ..Object::default()
    }
}

fn parcel() -> Object {
    Object {
        name: "parcel".to_owned(),
        shape: ObjectShape::Box { size: [0.1, 0.1, 0.04] },
        mass: Some(0.5),
        position: [-1.0, 0.0, 0.12],
        friction: 0.2,
        ..Object::default()
    }
}

#[test]
fn a_parcel_reaches_belt_speed_in_closed_form_time() {
    let (speed, mu) = (0.8, 0.3);
    let mut simulation = simulate(
        Engine::Articulated,
        World { objects: vec![belt(speed, 0.0), parcel()], ..World::default() },
    );
    let time = speed / (mu * G);
    run(&mut *simulation, 0.5 * time);
    let half = velocity(&*simulation, "parcel").x;
    assert!((half - 0.5 * speed).abs() < 0.01 * speed, "{half} m/s half way");
    run(&mut *simulation, 0.5 * time + 5e-3);
    let whole = velocity(&*simulation, "parcel");
    assert!((whole - Vector3::new(speed, 0.0, 0.0)).norm() < 0.01 * speed, "{whole}");
    let before = position(&*simulation, "parcel").x;
    let expected = -1.0 + 0.5 * speed * time + speed * 5e-3;
    assert!((before - expected).abs() < 2e-3, "{before} m, expected {expected} m");
    run(&mut *simulation, 0.5);
    let way = position(&*simulation, "parcel").x - before;
    assert!((way - 0.5 * speed).abs() < 1e-3, "it moves with the belt: {way} m in half a second");
}

#[test]
fn the_velocity_of_a_belt_turns_with_it() {
    let yaw = 0.7_f64;
    let parcel = Object { position: [0.0, 0.0, 0.12], ..parcel() };
    let mut simulation =
        simulate(Engine::Articulated, World { objects: vec![belt(0.5, yaw), parcel], ..World::default() });
    run(&mut *simulation, 0.5);
    let found = velocity(&*simulation, "parcel");
    let expected = Vector3::new(yaw.cos(), yaw.sin(), 0.0) * 0.5;
    assert!((found - expected).norm() < 5e-3, "{found}");
}

#[test]
fn ball_on_a_belt_slips_until_it_rolls() {
    // Sliding: v = mu g t, and r omega = (5/2) mu g t backwards. v - r omega reaches the belt speed at 2/7 of
    // it.
    let ball = Object {
        name: "parcel".to_owned(),
        shape: ObjectShape::Sphere { radius: 0.05 },
        position: [-1.0, 0.0, 0.15],
        ..parcel()
    };
    let mut simulation =
        simulate(Engine::Articulated, World { objects: vec![belt(0.7, 0.0), ball], ..World::default() });
    run(&mut *simulation, 0.5);
    let found = velocity(&*simulation, "parcel").x;
    assert!((found - 0.2).abs() < 2e-3, "{found} m/s");
}

#[test]
fn treadmill_ground_carries_a_stack_along() {
    let ground = Ground { conveyor: Some(Conveyor { velocity: [0.0, -0.3, 0.0] }), ..Ground::default() };
    // Too wide to tip, with more contact points than a matrix is formed for.
    let objects = (0..4).map(|index| Object {
        name: format!("box{index}"),
        shape: ObjectShape::Box { size: [0.4, 0.4, 0.05] },
        position: [0.0, 0.0, 0.025 + 0.05 * f64::from(index)],
        mass: Some(0.5),
        ..Object::default()
    });
    let world = World { ground: Some(ground), objects: objects.collect(), ..World::default() };
    let mut simulation = simulate(Engine::Articulated, world);
    run(&mut *simulation, 1.0);
    for index in 0..4 {
        let found = velocity(&*simulation, &format!("box{index}"));
        assert!((found - Vector3::new(0.0, -0.3, 0.0)).norm() < 5e-3, "box {index}: {found}");
    }
}

#[test]
fn engines_without_conveyors_reject_them() {
    for engine in engines().filter(|engine| *engine != Engine::Articulated) {
        let world = World { objects: vec![belt(0.5, 0.0)], ..World::default() };
        let refused = engine.refuse(world);
        assert!(refused.contains("simulates no conveyor, which \"belt\" has"), "{refused}");
    }
}

/// A ball of 0.5 kg with a drag area of 0.02 m2, at a height of one kilometre.
fn falling(wind: [f64; 3]) -> World {
    let ball = Object {
        name: "ball".to_owned(),
        shape: ObjectShape::Sphere { radius: 0.1 },
        mass: Some(0.5),
        position: [0.0, 0.0, 1000.0],
        drag: 0.02,
        ..Object::default()
    };
    World { objects: vec![ball], wind, ..World::default() }
}

#[test]
fn falling_ball_approaches_its_terminal_velocity() {
    let terminal = (2.0 * 0.5 * G / (1.225 * 0.02_f64)).sqrt();
    for engine in engines() {
        let mut simulation = simulate(engine, falling([0.0; 3]));
        run(&mut *simulation, 1.0);
        let expected = -terminal * (G / terminal).tanh();
        let found = velocity(&*simulation, "ball").z;
        assert!(
            (found - expected).abs() < 2e-3 * terminal,
            "{engine:?}: {found} m/s after 1 s, expected {expected}"
        );
        run(&mut *simulation, 14.0);
        let found = velocity(&*simulation, "ball").z;
        assert!((found + terminal).abs() < 1e-3 * terminal, "{engine:?}: {found} m/s, terminal {terminal}");
    }
}

#[test]
fn wind_carries_falling_objects_along() {
    for engine in engines() {
        let mut simulation = simulate(engine, falling([6.0, -2.0, 0.0]));
        run(&mut *simulation, 20.0);
        let found = velocity(&*simulation, "ball");
        assert!((found.x - 6.0).abs() < 0.02 && (found.y + 2.0).abs() < 0.02, "{engine:?}: {found}");
    }
}

#[test]
fn wind_does_not_move_objects_without_drag() {
    let world = falling([30.0, 0.0, 0.0]);
    let objects = world.objects.iter().map(|object| Object { drag: 0.0, ..object.clone() }).collect();
    let mut simulation = simulate(Engine::Articulated, World { objects, ..world });
    run(&mut *simulation, 1.0);
    let found = velocity(&*simulation, "ball");
    assert!((found - Vector3::new(0.0, 0.0, -G)).norm() < 1e-9, "{found}");
}

#[test]
fn world_number_out_of_range_is_rejected_by_key() {
    let refused = |world: World| world.check(std::iter::empty()).unwrap_err().to_string();
    let object = |object: Object| World { objects: vec![object], ..World::default() };
    assert_eq!(
        refused(World { air_density: -1.0, ..World::default() }),
        "world: `air_density` is -1, expected a number from 0 up"
    );
    assert_eq!(
        refused(object(Object { drag: f64::NAN, ..Object::default() })),
        "object: `drag` is NaN, expected a number from 0 up"
    );
    assert_eq!(
        refused(object(Object { rolling_friction: -0.1, ..Object::default() })),
        "object: `rolling_friction` is -0.1, expected a number from 0 up"
    );
    let conveyor = Some(Conveyor { velocity: [f64::INFINITY, 0.0, 0.0] });
    assert_eq!(
        refused(object(Object { conveyor, ..Object::default() })),
        "object: `conveyor.velocity` is inf, expected a finite number"
    );
}
