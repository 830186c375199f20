//! Rolling and torsional friction against closed forms, on every engine that supports them.

use motorium_physics::{BuildError, Ground, Object, ObjectShape, Options, RapierSimulator, Simulator, World};
use motorium_robots::{Model, load};
use nalgebra::{Isometry3, Vector3};

use crate::engines::{Engine, engines};
use crate::legged::body;

const G: f64 = 9.81;
const RADIUS: f64 = 0.1;

/// Engines with rolling and torsional friction.
fn able() -> impl Iterator<Item = Engine> {
    engines().filter(|engine| *engine != Engine::Rapier)
}

/// A ball of 2 kg as a robot with a floating base, on a ground with these coefficients. A contact has half of
/// them.
fn ball(engine: Engine, torsional: f64, rolling: f64, v: [f64; 6]) -> Box<dyn Simulator> {
    let ground = Ground { torsional_friction: torsional, rolling_friction: rolling, ..Ground::default() };
    let world = World { ground: Some(ground), ..World::default() };
    let q = [0.0, 0.0, RADIUS, 0.0, 0.0, 0.0, 1.0];
    let model = body(&format!(r#"<sphere radius="{RADIUS}"/>"#));
    let mut simulation = engine.simulate(model, world, &q, Options::default());
    simulation.reset(&q, &v).unwrap();
    simulation
}

/// A robot far above all objects.
fn pendulum() -> Model {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0))
}

fn run(simulation: &mut dyn Simulator, seconds: f64) {
    (0..(seconds * 1e3).round() as usize).for_each(|_| _ = simulation.step(1e-3).unwrap());
}

#[test]
fn a_rolling_ball_stops_by_rolling_friction() {
    let (arm, speed) = (0.004, 1.0);
    for engine in able() {
        // m a = -F and I alpha = F r - arm N with a = r alpha, I = 0.4 m r^2: a = -arm g / (1.4 r).
        let mut simulation = ball(engine, 0.0, 2.0 * arm, [speed, 0.0, 0.0, 0.0, speed / RADIUS, 0.0]);
        let slowing = arm * G / (1.4 * RADIUS);
        run(&mut *simulation, 1.2 * speed / slowing);
        let (distance, expected) = (simulation.configuration()[0], 0.5 * speed * speed / slowing);
        println!("{engine:?}: {distance} m, expected {expected} m");
        assert!((distance - expected).abs() < 0.02 * expected, "{engine:?}: {distance}, {expected}");
        let speed = Vector3::from_column_slice(&simulation.velocity()[..3]).norm();
        assert!(speed < 2e-3, "{engine:?}: {speed}");
    }
}

#[test]
fn a_ball_without_rolling_friction_rolls_on() {
    for engine in able() {
        let mut simulation = ball(engine, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0, 1.0 / RADIUS, 0.0]);
        run(&mut *simulation, 2.0);
        let distance = simulation.configuration()[0];
        assert!((distance - 2.0).abs() < 0.02, "{engine:?}: {distance}");
    }
}

#[test]
fn a_spinning_ball_stops_in_the_time_of_its_torsional_friction() {
    let (arm, rate) = (0.01, 20.0);
    for engine in able() {
        // I alpha = -arm N.
        let slowing = arm * G / (0.4 * RADIUS * RADIUS);
        let mut simulation = ball(engine, 2.0 * arm, 0.0, [0.0, 0.0, 0.0, 0.0, 0.0, rate]);
        run(&mut *simulation, 0.5 * rate / slowing);
        let spin = simulation.velocity()[5];
        assert!((spin - 0.5 * rate).abs() < 0.02 * rate, "{engine:?}: {spin} rad/s half way");
        run(&mut *simulation, 0.52 * rate / slowing);
        assert!(simulation.velocity()[5].abs() < 0.02 * rate, "{engine:?}: {}", simulation.velocity()[5]);
        assert!(simulation.configuration()[0].abs() < 1e-3, "{engine:?}: it stays where it is");
    }
}

#[test]
fn ball_on_a_slope_obeys_its_rolling_friction() {
    // With objects, both sides resist, and a contact uses the mean.
    for (angle, stands) in [(0.03_f64, true), (0.06, false)] {
        let arm = 0.04 * RADIUS;
        let object = Object {
            name: "ball".to_owned(),
            shape: ObjectShape::Sphere { radius: RADIUS },
            mass: Some(0.5),
            position: [1.0, 0.0, RADIUS],
            rolling_friction: 1.5 * arm,
            ..Object::default()
        };
        let ground = Ground { rolling_friction: 0.5 * arm, ..Ground::default() };
        let gravity = [G * angle.sin(), 0.0, -G * angle.cos()];
        let world = World { gravity, ground: Some(ground), objects: vec![object], ..World::default() };
        for engine in able() {
            let mut simulation = engine.simulate(pendulum(), world.clone(), &[0.0], Options::default());
            run(&mut *simulation, 1.0);
            let ball = simulation.object("ball").unwrap();
            let travelled = simulation.object_pose(ball).translation.x - 1.0;
            let free = 0.5 * G * (angle.sin() - 0.04 * angle.cos()) / 1.4;
            let expected = if stands { 0.0 } else { free };
            println!("{engine:?}, {angle} rad: {travelled} m, expected {expected} m");
            assert!((travelled - expected).abs() < 0.02 * free.abs(), "{engine:?}, {angle}: {travelled}");
        }
    }
}

#[test]
fn a_spinning_cylinder_stops_by_both_frictions() {
    // The rim slides: mu m g R. The four points of the rim together resist spinning with arm m g.
    let (radius, rate, arm) = (0.05, 20.0, 0.02);
    let model = body(&format!(r#"<cylinder radius="{radius}" length="0.04"/>"#));
    let ground = Ground { friction: 0.2, torsional_friction: 2.0 * arm, ..Ground::default() };
    let world = World { ground: Some(ground), ..World::default() };
    let options = Options { friction: 0.2, ..Options::default() };
    let q = [0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 1.0];
    let mut simulation = Engine::Articulated.simulate(model, world, &q, options);
    simulation.reset(&q, &[0.0, 0.0, 0.0, 0.0, 0.0, rate]).unwrap();
    let slowing = 2.0 * G * (0.2 * radius + arm) / 0.008;
    run(&mut *simulation, 0.5 * rate / slowing);
    let spin = simulation.velocity()[5];
    assert!((spin - 0.5 * rate).abs() < 0.03 * rate, "{spin} rad/s half way");
    run(&mut *simulation, 0.6 * rate / slowing);
    assert!(simulation.velocity()[5].abs() < 1e-6);
}

#[test]
fn saved_rolling_ball_continues_bit_for_bit() {
    let mut simulation = ball(Engine::Articulated, 0.004, 0.004, [1.0, 0.0, 0.0, 0.0, 10.0, 5.0]);
    run(&mut *simulation, 0.3);
    let saved = simulation.save();
    run(&mut *simulation, 0.5);
    let bits = |simulation: &dyn Simulator| -> Vec<u64> {
        simulation.configuration().iter().chain(simulation.velocity()).map(|x| x.to_bits()).collect()
    };
    let first = bits(&*simulation);
    simulation.restore(&saved).unwrap();
    run(&mut *simulation, 0.5);
    assert_eq!(bits(&*simulation), first);
}

#[test]
fn balls_in_a_heap_have_the_same_rolling_friction() {
    // Two rows on a plate form one island with more points than a matrix is formed for.
    let plate = Object {
        name: "plate".to_owned(),
        shape: ObjectShape::Box { size: [4.0, 3.0, 0.1] },
        mass: Some(50.0),
        position: [1.0, 0.0, 0.05],
        rolling_friction: 0.004,
        ..Object::default()
    };
    let balls = (0..12).map(|index| Object {
        name: format!("ball{index}"),
        shape: ObjectShape::Sphere { radius: RADIUS },
        mass: Some(0.5),
        position: [0.0, -1.2 + 0.22 * f64::from(index), 0.1 + RADIUS],
        rolling_friction: 0.004,
        ..Object::default()
    });
    let objects = std::iter::once(plate).chain(balls).collect();
    let world = World { ground: Some(Ground::default()), objects, ..World::default() };
    let mut simulation = Engine::Articulated.simulate(pendulum(), world, &[0.0], Options::default());
    let angle = 0.2_f64;
    simulation.set_gravity(Vector3::new(G * angle.sin(), 0.0, -G * angle.cos()));
    run(&mut *simulation, 0.5);
    let expected = G * (angle.sin() - 0.04 * angle.cos()) / 1.4 * 0.5;
    for index in 0..12 {
        let ball = simulation.object(&format!("ball{index}")).unwrap();
        let speed = simulation.object_velocity(ball).0.x;
        assert!(
            (speed - expected).abs() < 0.02 * expected,
            "ball {index}: {speed} m/s, expected {expected} m/s"
        );
    }
}

#[test]
fn rapier_rejects_rolling_friction_by_name() {
    let ground = Ground { rolling_friction: 1e-3, ..Ground::default() };
    let world = World { ground: Some(ground), ..World::default() };
    let refused = RapierSimulator::new(pendulum(), world, &[0.0], Options::default()).map(drop).unwrap_err();
    assert!(matches!(refused, BuildError::Unable { .. }));
    assert_eq!(
        refused.to_string(),
        "the rapier engine simulates no rolling friction, which \"ground\" has; use `physics.articulated` \
         (`ArticulatedSimulator`)"
    );
}
