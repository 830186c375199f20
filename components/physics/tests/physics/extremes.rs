//! Scenes at the limits of typical use: tiny and heavy objects, large mass ratios, tall stacks, thin plates
//! and walls, fast balls, fast spins, and objects that start inside each other.

use motorium_physics::{Ground, Object, ObjectShape, Simulator, World};
use motorium_worlds::CompoundPart;
use nalgebra::Vector3;

use crate::engines::Engine;
use crate::meshes::{pose, run, simulate};

const DT: f64 = 1e-3;
const G: f64 = 9.81;

fn cube(name: &str, side: f64, mass: f64, position: [f64; 3]) -> Object {
    plate(name, [side; 3], mass, position)
}

fn plate(name: &str, size: [f64; 3], mass: f64, position: [f64; 3]) -> Object {
    let shape = ObjectShape::Box { size };
    Object { name: name.to_owned(), shape, mass: Some(mass), position, ..Object::default() }
}

fn ball(radius: f64, mass: f64, position: [f64; 3]) -> Object {
    let shape = ObjectShape::Sphere { radius };
    Object { name: "ball".to_owned(), shape, mass: Some(mass), position, ..Object::default() }
}

fn on_ground(objects: Vec<Object>) -> Box<dyn Simulator> {
    simulate(Engine::Articulated, World { ground: Some(Ground::default()), objects, ..World::default() })
}

/// Objects in a world without gravity, the last of which flies along x.
fn thrown(mut objects: Vec<Object>, speed: f64) -> Box<dyn Simulator> {
    if let Some(last) = objects.last_mut() {
        last.velocity = [speed, 0.0, 0.0];
    }
    simulate(Engine::Articulated, World { gravity: [0.0; 3], objects, ..World::default() })
}

#[test]
fn cubes_of_five_millimetres_stand_on_one_another() {
    // Steel: one gram each.
    let objects = (0..3).map(|layer| {
        cube(&format!("cube_{layer}"), 5e-3, 1e-3, [0.0, 0.0, 2.5e-3 + 5e-3 * f64::from(layer)])
    });
    let mut simulation = on_ground(objects.collect());
    run(&mut *simulation, 2.0);
    for layer in 0..3 {
        let at = pose(&*simulation, &format!("cube_{layer}"));
        let height = 2.5e-3 + 5e-3 * f64::from(layer);
        assert!(
            (at.translation.z - height).abs() < 1e-4,
            "layer {layer}: {} m of {height} m",
            at.translation.z
        );
        assert!(at.rotation.angle() < 0.02, "layer {layer} turns by {}", at.rotation.angle());
    }
}

#[test]
fn a_cube_of_a_millimetre_falls_onto_the_ground_and_stays() {
    let mut simulation = on_ground(vec![cube("grain", 1e-3, 1e-6, [0.0, 0.0, 0.05])]);
    run(&mut *simulation, 1.0);
    let at = pose(&*simulation, "grain").translation.vector;
    assert!((at.z - 5e-4).abs() < 5e-5 && at.xy().norm() < 1e-3, "{at}");
}

#[test]
fn a_hundred_kilograms_stand_on_a_hundred_grams() {
    for ratio in [10.0, 100.0, 1000.0] {
        let objects =
            vec![cube("light", 0.2, 0.1, [0.0, 0.0, 0.1]), cube("heavy", 0.2, 0.1 * ratio, [0.0, 0.0, 0.3])];
        let mut simulation = on_ground(objects);
        run(&mut *simulation, 3.0);
        for (name, height) in [("light", 0.1), ("heavy", 0.3)] {
            let at = pose(&*simulation, name);
            let off = (at.translation.vector - Vector3::new(0.0, 0.0, height)).norm();
            assert!(off < 2e-3, "1:{ratio}: {name} is off by {off} m");
            assert!(at.rotation.angle() < 5e-3, "1:{ratio}: {name} turns by {}", at.rotation.angle());
        }
        let mut force = 0.0;
        simulation.visit_contacts(&mut |contact| {
            force +=
                if contact.first == "ground" || contact.second == "ground" { contact.force } else { 0.0 };
        });
        let weight = 0.1 * (1.0 + ratio) * G;
        assert!((force - weight).abs() < 0.02 * weight, "1:{ratio}: {force} N of {weight} N");
    }
}

#[test]
fn a_stack_of_ten_stands_and_sleeps() {
    let height = |layer: usize| 0.05 + 0.1 * layer as f64;
    let objects = (0..10).map(|layer| cube(&format!("cube_{layer}"), 0.1, 0.5, [0.0, 0.0, height(layer)]));
    let mut simulation = on_ground(objects.collect());
    run(&mut *simulation, 5.0);
    let mut most = 0.0_f64;
    for layer in 0..10 {
        let at = pose(&*simulation, &format!("cube_{layer}"));
        let off = (at.translation.vector - Vector3::new(0.0, 0.0, height(layer))).norm();
        let tilt = (at.rotation * Vector3::z()).angle(&Vector3::z());
        assert!(off < 5e-3 && tilt < 5e-3, "layer {layer}: off by {off} m, tilted by {tilt}");
        most = most.max(at.rotation.angle());
    }
    println!("tower of ten: turned about the vertical by {most:.1e} rad in 5 s");
    assert!(most < 1e-4, "it turns by {most} rad");
    for layer in 0..10 {
        let (linear, angular) =
            simulation.object_velocity(simulation.object(&format!("cube_{layer}")).unwrap());
        assert!(linear.norm() == 0.0 && angular.norm() == 0.0, "layer {layer} sleeps");
    }
}

#[test]
fn a_sheet_of_a_millimetre_lies_flat_and_carries_a_ball() {
    let objects =
        vec![plate("sheet", [1.0, 1.0, 1e-3], 2.7, [0.0, 0.0, 6e-4]), ball(0.05, 1.0, [0.1, 0.2, 0.06])];
    let mut simulation = on_ground(objects);
    run(&mut *simulation, 2.0);
    let sheet = pose(&*simulation, "sheet");
    assert!((sheet.translation.z - 5e-4).abs() < 2e-4 && sheet.rotation.angle() < 2e-3, "{sheet}");
    let height = pose(&*simulation, "ball").translation.z;
    assert!((height - 0.051).abs() < 3e-4, "{height} m");
}

#[test]
fn a_fast_ball_does_not_pass_a_thin_wall() {
    for (radius, thick) in [(0.03, 0.005), (0.01, 0.005), (0.005, 0.002), (0.003, 0.001)] {
        let wall = Object {
            name: "wall".to_owned(),
            shape: ObjectShape::Box { size: [thick, 1.0, 1.0] },
            position: [2.0, 0.0, 0.0],
            ..Object::default()
        };
        for offset in [0.0, 0.004, 0.009, 0.013] {
            let mut simulation = thrown(vec![wall.clone(), ball(radius, 0.01, [offset, 0.0, 0.0])], 20.0);
            run(&mut *simulation, 0.2);
            let at = pose(&*simulation, "ball").translation.vector;
            assert!(at.x < 2.0, "radius {radius} m, wall {thick} m, offset {offset} m: at {at}");
        }
    }
}

#[test]
fn a_fast_cube_does_not_pass_a_thin_wall() {
    let wall = Object {
        name: "wall".to_owned(),
        shape: ObjectShape::Box { size: [0.004, 1.0, 1.0] },
        position: [2.0, 0.0, 0.0],
        ..Object::default()
    };
    for rpy in [[0.0; 3], [0.3, 0.5, 0.7]] {
        let bullet = Object { rpy, ..cube("ball", 0.01, 0.01, [0.007, 0.0, 0.0]) };
        let mut simulation = thrown(vec![wall.clone(), bullet], 20.0);
        run(&mut *simulation, 0.2);
        let at = pose(&*simulation, "ball").translation.vector;
        assert!(at.x < 2.0, "turned by {rpy:?}: at {at}");
    }
}

#[test]
fn overlapping_objects_separate_slowly_and_rest() {
    let objects =
        vec![cube("lower", 0.1, 1.0, [0.0, 0.0, 0.03]), cube("upper", 0.1, 1.0, [0.01, 0.005, 0.11])];
    let mut simulation = on_ground(objects);
    let mut fastest = 0.0_f64;
    for _ in 0..3000 {
        simulation.step(DT).unwrap();
        for name in ["lower", "upper"] {
            let (linear, _) = simulation.object_velocity(simulation.object(name).unwrap());
            fastest = fastest.max(linear.norm());
        }
    }
    assert!(fastest < 2.0, "they are shot apart at {fastest} m/s");
    let (lower, upper) = (pose(&*simulation, "lower"), pose(&*simulation, "upper"));
    assert!((lower.translation.z - 0.05).abs() < 1e-3, "{lower}");
    assert!((upper.translation.z - 0.15).abs() < 2e-3, "{upper}");
}

#[test]
fn spinning_top_precesses_as_in_closed_form() {
    // A disc on a stem whose tip is on the ground; high friction holds the tip.
    let disc = CompoundPart {
        shape: ObjectShape::Cylinder { radius: 0.06, length: 0.02 },
        position: [0.0, 0.0, 0.08],
        rpy: [0.0; 3],
        mass: Some(0.5),
    };
    let tip = CompoundPart {
        shape: ObjectShape::Sphere { radius: 1e-3 },
        position: [0.0, 0.0, 1e-3],
        rpy: [0.0; 3],
        mass: Some(0.0),
    };
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.2, 0.0);
    let spin = turn * Vector3::z() * 200.0;
    let top = Object {
        name: "top".to_owned(),
        shape: ObjectShape::Compound(vec![disc, tip]),
        friction: 5.0,
        rpy: [0.0, 0.2, 0.0],
        angular_velocity: spin.into(),
        // Its tip is stationary.
        velocity: spin.cross(&(turn * Vector3::new(0.0, 0.0, 0.08))).into(),
        ..Object::default()
    };
    let ground = Some(Ground { friction: 5.0, ..Ground::default() });
    let world = World { ground, objects: vec![top], ..World::default() };
    let mut simulation = simulate(Engine::Articulated, world);
    let heading = |simulation: &dyn Simulator| {
        let axis = pose(simulation, "top").rotation * Vector3::z();
        (axis.y.atan2(axis.x), axis.z.acos())
    };
    let (mut before, mut turned, mut tilts) = (heading(&*simulation).0, 0.0, (f64::INFINITY, 0.0_f64));
    for _ in 0..500 {
        simulation.step(DT).unwrap();
        let (now, tilt) = heading(&*simulation);
        let by =
            (now - before + core::f64::consts::PI).rem_euclid(core::f64::consts::TAU) - core::f64::consts::PI;
        (before, turned, tilts) = (now, turned + by, (tilts.0.min(tilt), tilts.1.max(tilt)));
    }
    // m g l / (I w) of a fast top.
    let (mass, arm, inertia) = (0.5, 0.08, 0.5 * 0.5 * 0.06 * 0.06);
    let expected = mass * G * arm / (inertia * 200.0) * 0.5;
    assert!((turned - expected).abs() < 0.05 * expected, "{turned} rad in 0.5 s, expected {expected}");
    assert!(tilts.0 > 0.19 && tilts.1 < 0.23, "it nods between {} and {} rad", tilts.0, tilts.1);
    for _ in 500..2000 {
        simulation.step(DT).unwrap();
        let (now, tilt) = heading(&*simulation);
        let by =
            (now - before + core::f64::consts::PI).rem_euclid(core::f64::consts::TAU) - core::f64::consts::PI;
        (before, turned, tilts) = (now, turned + by, (tilts.0.min(tilt), tilts.1.max(tilt)));
    }
    println!(
        "top of 200 rad/s: turned by {turned:.3} of {:.3} rad and leaned by {:.3} rad more in 2 s",
        4.0 * expected,
        tilts.1 - 0.2
    );
    assert!((turned - 4.0 * expected).abs() < 0.05 * 4.0 * expected, "{turned} rad in 2 s");
    assert!(tilts.0 > 0.15 && tilts.1 < 0.32, "it nods between {} and {} rad in 2 s", tilts.0, tilts.1);
}
