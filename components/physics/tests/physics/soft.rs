//! Compliant surfaces, against the closed forms of a spring with a damper.

use motorium_physics::{
    ArticulatedSimulator, Ground, Object, ObjectShape, Options, RobotSetup, Simulator, Softness, World,
};
use motorium_robots::{Model, load};

use crate::engines::{Engine, engines};

const G: f64 = 9.81;
const MASS: f64 = 2.0;
const RADIUS: f64 = 0.1;

fn pendulum() -> Model {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    pendulum.placed(&nalgebra::Isometry3::translation(0.0, 0.0, 50.0))
}

fn ball(height: f64) -> Object {
    Object {
        name: "ball".to_owned(),
        shape: ObjectShape::Sphere { radius: RADIUS },
        mass: Some(MASS),
        position: [0.0, 0.0, RADIUS + height],
        ..Object::default()
    }
}

fn on_soft_ground(stiffness: f64, damping: f64, objects: Vec<Object>) -> ArticulatedSimulator {
    let ground = Some(Ground { soft: Some(Softness { stiffness, damping }), ..Ground::default() });
    let world = World { ground, objects, ..World::default() };
    ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap()
}

fn height(simulation: &ArticulatedSimulator, name: &str) -> f64 {
    simulation.object_pose(simulation.object(name).unwrap()).translation.z
}

#[test]
fn a_ball_sinks_by_weight_over_stiffness() {
    for h in [1e-2, 1e-3, 1e-4] {
        let mut simulation = on_soft_ground(5e3, 80.0, vec![ball(0.0)]);
        (0..(3.0 / h) as usize).for_each(|_| _ = simulation.step(h).unwrap());
        let depth = RADIUS - height(&simulation, "ball");
        let expected = MASS * G / 5e3;
        // Each contact point also has a compliance of a millionth of its mobility.
        assert!((depth / expected - 1.0).abs() < 1e-4, "step {h} s: {depth} m, expected {expected} m");
    }
}

#[test]
fn ball_on_a_damped_spring_swings_as_in_closed_form() {
    let (stiffness, damping, h) = (2e4, 20.0, 2e-5);
    let mut simulation = on_soft_ground(stiffness, damping, vec![ball(0.0)]);
    let rest = -MASS * G / stiffness;
    let decay = 0.5 * damping / MASS;
    let omega = (stiffness / MASS - decay * decay).sqrt();
    for step in 1..5000 {
        simulation.step(h).unwrap();
        let t = f64::from(step) * h;
        // From the height of the ground at rest: z'' = -k z / m - d z' / m - g.
        let expected =
            rest - rest * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin());
        let found = height(&simulation, "ball") - RADIUS;
        assert!((found - expected).abs() < 0.02 * rest.abs(), "{t} s: {found} m, expected {expected} m");
    }
}

#[test]
fn box_stands_on_a_spring_at_each_corner() {
    let brick = Object { shape: ObjectShape::Box { size: [0.2; 3] }, position: [0.0, 0.0, 0.1], ..ball(0.0) };
    let mut simulation = on_soft_ground(4e3, 100.0, vec![brick]);
    (0..3000).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let (depth, expected) = (0.1 - height(&simulation, "ball"), MASS * G / (4.0 * 4e3));
    assert!((depth / expected - 1.0).abs() < 1e-3, "{depth} m, expected {expected} m");
}

#[test]
fn two_soft_surfaces_are_springs_in_series() {
    let soft = Some(Softness { stiffness: 3e3, damping: 50.0 });
    let mut simulation = on_soft_ground(6e3, 50.0, vec![Object { soft, ..ball(0.0) }]);
    (0..3000).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let (depth, expected) = (RADIUS - height(&simulation, "ball"), MASS * G / 2e3);
    assert!((depth / expected - 1.0).abs() < 1e-3, "{depth} m, expected {expected} m");
}

#[test]
fn a_tower_presses_its_lowest_box_in_by_the_weight_of_all() {
    // Twenty contact points: an island that is solved body by body.
    let boxes = (0..5).map(|level| Object {
        name: format!("box{level}"),
        shape: ObjectShape::Box { size: [0.2; 3] },
        position: [0.0, 0.0, 0.1 + 0.2 * f64::from(level)],
        ..ball(0.0)
    });
    let mut simulation = on_soft_ground(2e4, 300.0, boxes.collect());
    (0..4000).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let (depth, expected) = (0.1 - height(&simulation, "box0"), 5.0 * MASS * G / (4.0 * 2e4));
    assert!((depth / expected - 1.0).abs() < 0.01, "{depth} m, expected {expected} m");
}

#[test]
fn a_ball_leaves_an_undamped_spring_at_its_speed() {
    // A drop of 0.2 m: fall and flight take 2 sqrt(2 h / g), the contact about pi sqrt(m / k).
    let mut simulation = on_soft_ground(2e4, 0.0, vec![ball(0.2)]);
    let h = 2e-5;
    let (mut touched, mut highest) = (false, 0.0_f64);
    for _ in 0..(0.45 / h) as usize {
        simulation.step(h).unwrap();
        let now = height(&simulation, "ball") - RADIUS;
        touched |= now < 0.0;
        if touched {
            highest = highest.max(now);
        }
    }
    assert!((0.19..0.2001).contains(&highest), "{highest}");
}

#[test]
fn soft_link_yields_and_rigid_link_does_not() {
    let text = r#"<robot name="anvil"><link name="anvil">
    <collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="anvil"/><child link="pointer"/><origin xyz="5 0 0.5"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
  <link name="pointer"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>"#;
    let options = motorium_robots::LoadOptions::default();
    let anvil = motorium_robots::parse_urdf_with(text, None, &options).unwrap().model;
    for (link, expected) in [("anvil", MASS * G / 5e3), ("pointer", 0.0)] {
        let mut setup = RobotSetup::from(anvil.clone());
        setup.soft.insert(link.to_owned(), Softness { stiffness: 5e3, damping: 80.0 });
        let world = World { objects: vec![ball(0.1)], ..World::default() };
        let mut simulation = ArticulatedSimulator::new(setup, world, &[0.0], Options::default()).unwrap();
        (0..3000).for_each(|_| _ = simulation.step(1e-3).unwrap());
        let depth = 0.1 + RADIUS - height(&simulation, "ball");
        assert!((depth - expected).abs() < 2e-5, "{link}: {depth} m, expected {expected} m");
    }
}

#[test]
fn impossible_soft_surfaces_are_rejected() {
    let world = |stiffness, damping| {
        let soft = Some(Softness { stiffness, damping });
        World { objects: vec![Object { soft, ..ball(0.0) }], ..World::default() }
    };
    let own = |stiffness, damping| Engine::Articulated.refuse(world(stiffness, damping));
    assert_eq!(own(0.0, 0.0), "ball: `soft.stiffness` is 0, expected a positive number");
    assert_eq!(own(1.0, -1.0), "ball: `soft.damping` is -1, expected a number from 0 up");
    for engine in engines().filter(|engine| *engine != Engine::Articulated) {
        let words = engine.refuse(world(1e3, 0.0));
        assert!(words.contains("simulates no soft surface, which \"ball\" has"), "{words}");
    }
}
