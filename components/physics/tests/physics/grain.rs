//! Direction-dependent friction, against Coulomb's law along and across the grain.

use motorium_physics::{ArticulatedSimulator, Grain, Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::{Model, load};
use motorium_worlds::FrictionCombine;

use crate::engines::{Engine, engines};

const G: f64 = 9.81;

/// Friction coefficients of the contact between the plank and the ground, along and across the grain.
const ALONG: f64 = 0.1;
const ACROSS: f64 = 0.6;

fn pendulum() -> Model {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    pendulum.placed(&nalgebra::Isometry3::translation(0.0, 0.0, 50.0))
}

/// A plank with a grain along its x axis, rotated by `yaw`.
fn plank(yaw: f64) -> Object {
    Object {
        name: "plank".to_owned(),
        shape: ObjectShape::Box { size: [0.3, 0.2, 0.04] },
        mass: Some(1.0),
        position: [0.0, 0.0, 0.02],
        rpy: [0.0, 0.0, yaw],
        friction: 2.0 * ACROSS,
        grain: Some(Grain { direction: [2.0, 0.0, 0.0], friction: 2.0 * ALONG }),
        ..Object::default()
    }
}

/// Position of the plank after a second on a slope along `direction` with this sideways acceleration.
fn slide(objects: Vec<Object>, ground: Ground, direction: [f64; 2], sideways: f64) -> [f64; 2] {
    let gravity = [direction[0] * sideways, direction[1] * sideways, -G];
    let world = World { gravity, ground: Some(ground), objects, ..World::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap();
    (0..1000).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let place = simulation.object_pose(simulation.object("plank").unwrap()).translation;
    [place.x, place.y]
}

/// A frictionless ground: a contact has half of the plank's friction.
fn smooth() -> Ground {
    Ground { friction: 0.0, friction_combine: Some(FrictionCombine::Mean), ..Ground::default() }
}

#[test]
fn a_plank_slides_along_its_grain_only() {
    let pull = 0.4 * G;
    for yaw in [0.0, 0.7, 2.0, -1.2_f64] {
        let (along, across) = ([yaw.cos(), yaw.sin()], [-yaw.sin(), yaw.cos()]);
        let slid = slide(vec![plank(yaw)], smooth(), along, pull);
        let way = slid[0] * along[0] + slid[1] * along[1];
        let expected = 0.5 * (pull - ALONG * G);
        assert!((way - expected).abs() < 5e-3, "yaw {yaw}: {way} m along, expected {expected} m");
        let held = slide(vec![plank(yaw)], smooth(), across, pull);
        assert!(held[0].hypot(held[1]) < 1e-6, "yaw {yaw}: {held:?} across");
        let beyond = slide(vec![plank(yaw)], smooth(), across, 0.8 * G);
        let (way, expected) = (beyond[0].hypot(beyond[1]), 0.5 * 0.2 * G);
        assert!((way - expected).abs() < 5e-3, "yaw {yaw}: {way} m across, expected {expected} m");
    }
}

#[test]
fn largest_friction_forces_form_an_ellipse() {
    for angle in [0.2, 0.6, 1.0, 1.4_f64] {
        let direction = [angle.cos(), angle.sin()];
        let edge = 1.0 / (direction[0] / ALONG).hypot(direction[1] / ACROSS);
        for (share, slides) in [(0.97, false), (1.03, true)] {
            let place = slide(vec![plank(0.0)], smooth(), direction, share * edge * G);
            let way = place[0].hypot(place[1]);
            assert_eq!(way > 1e-4, slides, "angle {angle}, {share} of the edge: {way} m");
        }
    }
}

#[test]
fn a_tower_on_a_plank_slides_with_it() {
    // Twenty contact points: an island that is solved body by body.
    let boxes = (0..4).map(|level| Object {
        name: format!("box{level}"),
        shape: ObjectShape::Box { size: [0.2, 0.2, 0.04] },
        mass: Some(1.0),
        position: [0.0, 0.0, 0.06 + 0.04 * f64::from(level)],
        friction: 2.0,
        ..Object::default()
    });
    let objects: Vec<Object> = std::iter::once(plank(0.0)).chain(boxes).collect();
    let slid = slide(objects.clone(), smooth(), [1.0, 0.0], 0.4 * G);
    let expected = 0.5 * (0.4 - ALONG) * G;
    assert!((slid[0] - expected).abs() < 0.01 && slid[1].abs() < 1e-3, "{slid:?}, expected {expected} m");
    let held = slide(objects, smooth(), [0.0, 1.0], 0.4 * G);
    assert!(held[0].hypot(held[1]) < 1e-3, "{held:?}");
}

#[test]
fn grain_of_the_ground_is_in_world_axes() {
    let ground = Ground {
        friction: 2.0 * ACROSS,
        grain: Some(Grain { direction: [0.0, 1.0, 0.0], friction: 2.0 * ALONG }),
        ..Ground::default()
    };
    let brick =
        Object { grain: None, friction: 0.0, friction_combine: Some(FrictionCombine::Mean), ..plank(0.4) };
    let slid = slide(vec![brick.clone()], ground, [0.0, 1.0], 0.4 * G);
    assert!((slid[1] - 0.5 * (0.4 - ALONG) * G).abs() < 5e-3, "{slid:?}");
    let held = slide(vec![brick], ground, [1.0, 0.0], 0.4 * G);
    assert!(held[0].hypot(held[1]) < 1e-6, "{held:?}");
}

#[test]
fn grain_without_direction_is_rejected() {
    let world = |direction| {
        let grain = Some(Grain { direction, friction: 0.1 });
        World { objects: vec![Object { grain, ..plank(0.0) }], ..World::default() }
    };
    let words = Engine::Articulated.refuse(world([0.0; 3]));
    assert_eq!(words, "plank: `grain.direction` is 0, expected a vector of nonzero length");
    for engine in engines().filter(|engine| *engine != Engine::Articulated) {
        let words = engine.refuse(world([1.0, 0.0, 0.0]));
        assert!(words.contains("simulates no direction-dependent friction"), "{words}");
    }
}
