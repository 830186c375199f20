//! Long bodies rest across ridges of a terrain, and bodies of every shape on rough ground.

use motorium_physics::{ArticulatedSimulator, Object, Options, World};
use nalgebra::{Isometry3, Vector3};

use crate::meshes::pendulum;
use crate::pairs::{Body, DRIFT, ROTATION, bodies, drift};

/// Settling time of a body after it has been placed, and the time for which it then rests \[s\].
const SETTLING: f64 = 5.0;
const RESTING: f64 = 10.0;

/// Placement of bodies on rough ground along x and y \[m\]: symmetric to no cell, so that no rim lies exactly
/// on a peak.
const OFF_GRID: [f64; 2] = [0.0031, -0.0074];

/// Places a body on a terrain. Returns its drift \[m\], rotation \[rad\], speed, and the sinking of its
/// centre below the height where it was placed \[m\].
fn rest(terrain: &str, body: Body, turn: f64, [x, y, height]: [f64; 3]) -> [f64; 4] {
    let text = format!("size = [1.0, 1.0]\nfriction = 0.8\n{terrain}");
    let rotation = Isometry3::rotation(Vector3::z() * turn)
        * Isometry3::new(Vector3::zeros(), Vector3::y() * body.object.rpy[1]);
    let z = height + body.height;
    let object = Object { position: [x, y, z], rpy: rotation.rotation.euler_angles().into(), ..body.object };
    let name = object.name.clone();
    let world =
        World { objects: vec![object], terrain: Some(toml::from_str(&text).unwrap()), ..World::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap();
    let (far, turned, speed) = drift(&mut simulation, &name, [SETTLING, RESTING]);
    let id = motorium_physics::Simulator::object(&simulation, &name).unwrap();
    let sunk = z - motorium_physics::Simulator::object_pose(&simulation, id).translation.vector.z;
    [far, turned, speed, sunk]
}

#[test]
fn long_bodies_rest_across_ridges() {
    let mut failures = Vec::new();
    // two ridges along x, with tops of 2 cm and with sharp ones
    let ridges = [
        (
            "flat tops",
            "spacing = 0.02\nlayers = [{ equation = { height = '-0.04 * min(1, max(0, (abs(abs(y) - 0.06) - 0.01) / 0.02))' } }]",
        ),
        ("sharp", "spacing = 0.02\nlayers = [{ equation = { height = '-abs(abs(y) - 0.06)' } }]"),
        ("wide cells", "spacing = 0.04\nlayers = [{ equation = { height = '-abs(abs(y) - 0.06)' } }]"),
        ("diagonal", "spacing = 0.05\nlayers = [{ equation = { height = '-abs(abs(x - y) - 0.1)' } }]"),
    ];
    for (name, terrain) in ridges {
        for turn in [1.57, 1.2, 0.785] {
            for body in bodies().into_iter().filter(|body| {
                let long = ["long box", "lying cylinder", "capsule", "hull"];
                long.contains(&body.object.name.as_str())
            }) {
                let turn = if name == "diagonal" { turn + 0.785 } else { turn };
                let object = body.object.name.clone();
                let [far, turned, speed, sunk] = rest(terrain, body, turn, [0.0; 3]);
                let line = format!(
                    "{object} across {name} at {turn}: {:.4} mm, {:.4} degrees, {speed:.1e} m/s, {:.4} mm deep",
                    far * 1e3,
                    turned.to_degrees(),
                    sunk * 1e3
                );
                if far > DRIFT || turned > ROTATION || speed > 0.0 || sunk.abs() > DRIFT {
                    failures.push(line);
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_shape_rests_on_rough_ground() {
    let mut failures = Vec::new();
    for seed in 0..4 {
        for layers in [
            "{ diamond_square = { height = 0.05, roughness = 0.5 } }",
            "{ stones = { height = 0.012, size = 0.1, per_square_metre = 60.0 } }",
        ] {
            for body in bodies() {
                // round bodies may roll downhill
                if ["sphere", "capsule", "lying cylinder"].contains(&body.object.name.as_str()) {
                    continue;
                }
                let terrain = format!("spacing = 0.02\nseed = {seed}\nlayers = [{layers}]");
                let object = body.object.name.clone();
                let [far, turned, speed, _] = rest(&terrain, body, 0.4, [OFF_GRID[0], OFF_GRID[1], 0.06]);
                let line = format!(
                    "{object} on {layers} {seed}: {:.4} mm, {:.4} degrees, {speed:.1e} m/s",
                    far * 1e3,
                    turned.to_degrees(),
                );
                if far > DRIFT || turned > ROTATION || speed > 0.0 {
                    failures.push(line);
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}:\n{}", failures.len(), failures.join("\n"));
}
