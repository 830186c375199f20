//! The first step from a state against forward dynamics: the engine integrates the right equations.

mod panda;

use std::path::Path;

use motorium_physics::{Contacts, JointCommand, Options, Rapier, Simulator, World};
use motorium_robots::{Dynamics, MimicMode, Model, PackagePath, parse_urdf};
use nalgebra::Vector3;
use serde_json::Value;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn options(contacts: Contacts) -> Options {
    Options { contacts, contact_iterations: 1, self_collision: false, ..Options::default() }
}

/// Acceleration over one short step under pure effort.
fn acceleration(simulation: &mut Rapier, q: &[f64], v: &[f64], tau: &[f64], dt: f64) -> Vec<f64> {
    simulation.reset(q, v).unwrap();
    for (command, tau) in simulation.commands_mut().iter_mut().zip(tau) {
        *command = JointCommand::effort(*tau);
    }
    simulation.step(dt).unwrap();
    simulation.velocities().iter().zip(v).map(|(after, before)| (after - before) / dt).collect()
}

/// Largest difference, relative to the largest entry.
fn error(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected.iter().fold(1e-12_f64, |m, x| m.max(x.abs()));
    found.iter().zip(expected).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs() / scale))
}

/// The robot without damping, friction and effort limits, which forward dynamics does not know.
fn ideal(urdf: &str) -> Model {
    let mut text = String::new();
    for line in urdf.split_inclusive('>') {
        let dynamics = line.trim_start().starts_with("<dynamics");
        text.push_str(if dynamics { "" } else { line });
    }
    parse_urdf(&unlimited(&text), None, MimicMode::Independent, &PackagePath::default()).unwrap().model
}

/// Every effort limit becomes one nobody meets.
fn unlimited(urdf: &str) -> String {
    let mut text = String::new();
    let mut rest = urdf;
    while let Some(at) = rest.find("effort=\"") {
        let value = at + "effort=\"".len();
        let end = value + rest[value..].find('"').unwrap();
        text.push_str(&rest[..value]);
        text.push_str("1e9");
        rest = &rest[end..];
    }
    text + rest
}

/// A deterministic number in (-1, 1).
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    ((*seed >> 11) as f64 / (1u64 << 52) as f64) - 1.0
}

#[test]
fn the_panda_accelerates_as_forward_dynamics_says() {
    let urdf = panda::loaded().entry.unwrap().urdf;
    let model = ideal(urdf);
    let n = model.nv();
    for (contacts, bar) in [(Contacts::WhenNear, 1e-9), (Contacts::Always, 2e-4)] {
        let mut simulation =
            Rapier::new(model.clone(), World::default(), &vec![0.0; n], options(contacts)).unwrap();
        let mut seed = 1;
        let mut worst = 0.0_f64;
        for _ in 0..20 {
            let q: Vec<f64> = (0..n)
                .map(|i| {
                    let (low, high) = (model.lower()[i].max(-2.0), model.upper()[i].min(2.0));
                    low + (0.5 + 0.45 * noise(&mut seed)) * (high - low)
                })
                .collect();
            // Fingers move slowly enough to stay inside their 4 cm during the step.
            let v: Vec<f64> = (0..n).map(|i| noise(&mut seed) * if i < 7 { 2.0 } else { 0.1 }).collect();
            let tau: Vec<f64> = (0..n).map(|_| 5.0 * noise(&mut seed)).collect();
            let mut expected = vec![0.0; n];
            Dynamics::new(&model).forward(&model, &q, &v, &tau, GRAVITY, &mut expected).unwrap();
            let found = acceleration(&mut simulation, &q, &v, &tau, 1e-6);
            worst = worst.max(error(&found, &expected));
        }
        println!("{contacts:?}: worst relative error {worst:.1e}");
        assert!(worst < bar, "{contacts:?}: {worst:e}");
    }
}

/// Golden vectors from an independent implementation, when they and the robots they belong to are at hand.
#[test]
fn published_robots_accelerate_as_the_golden_vectors_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in ["panda", "ur5"] {
        let vectors = root.join("../shared/golden").join(format!("{name}.json"));
        let Some(urdf) = published_urdf(name) else {
            println!("skipped {name}: set MOTORIUM_ROBOT_DATA to an unpacked example-robot-data wheel");
            continue;
        };
        let Ok(vectors) = std::fs::read_to_string(&vectors) else {
            println!("skipped {name}: no {}", vectors.display());
            continue;
        };
        let golden: Value = serde_json::from_str(&vectors).unwrap();
        let model = ideal(&urdf);
        let order: Vec<usize> = model
            .joint_names()
            .iter()
            .map(|joint| {
                let joints = golden["joints"].as_array().unwrap();
                let found = joints.iter().find(|entry| entry["name"] == joint.as_str()).unwrap();
                found["idx_v"].as_u64().unwrap() as usize
            })
            .collect();
        let n = model.nv();
        for (contacts, dt, bar) in
            [(Contacts::WhenNear, 1e-5, 1e-9), (Contacts::Always, 1e-5, 1e-3), (Contacts::Always, 1e-7, 1e-5)]
        {
            let mut simulation =
                Rapier::new(model.clone(), World::default(), &vec![0.0; n], options(contacts)).unwrap();
            let (mut worst, mut count) = (0.0_f64, 0);
            for case in golden["cases"].as_array().unwrap() {
                let pick = |key: &str| -> Vec<f64> {
                    order.iter().map(|&i| case[key][i].as_f64().unwrap()).collect()
                };
                let (q, v, tau, expected) = (pick("q"), pick("v"), pick("tau"), pick("aba"));
                let inside = (0..n).all(|i| {
                    let travel = 10.0 * dt * (v[i].abs() + dt * expected[i].abs());
                    q[i] - travel > model.lower()[i] && q[i] + travel < model.upper()[i]
                });
                if inside {
                    let found = acceleration(&mut simulation, &q, &v, &tau, dt);
                    worst = worst.max(error(&found, &expected));
                    count += 1;
                }
            }
            println!("{name}, {contacts:?}, dt {dt:e}: {count} cases, worst relative error {worst:.1e}");
            assert!(count >= 10, "{name}: only {count} cases start inside the limits");
            assert!(worst < bar, "{name}, {contacts:?}, dt {dt:e}: {worst:e}");
        }
    }
}

fn published_urdf(name: &str) -> Option<String> {
    let root = std::env::var_os("MOTORIUM_ROBOT_DATA")?;
    let file = match name {
        "panda" => "panda_description/urdf/panda.urdf",
        _ => "ur_description/urdf/ur5_robot.urdf",
    };
    let robots = Path::new(&root).join("cmeel.prefix/share/example-robot-data/robots");
    std::fs::read_to_string(robots.join(file)).ok()
}
