//! The first step from a state against Pinocchio's forward dynamics: the engine integrates the right
//! equations.
//!
//! The test always covers the catalogue's Panda. It also covers the Panda and UR5 of the PyPI package
//! `example-robot-data` if they are on this machine: URDFs in `MOTORIUM_EXAMPLE_ROBOT_DATA` (a folder that
//! contains `panda_description` and others) or in the `python3` of the path, vectors in `MOTORIUM_GOLDEN` or
//! `../shared/golden` next to the repository.

use std::path::{Path, PathBuf};
use std::process::Command;

use motorium_physics::{JointSetpoint, Options, Simulator, World};
use motorium_robots::{MimicMode, Model, PackagePath, parse_urdf};
use serde_json::Value;

use crate::engines::{Engine, engines};
use crate::panda;

/// Engine, step \[s\], and bound on the error of the first step against forward dynamics, relative to the
/// largest acceleration. The articulated engine solves exactly the same equations. So does MuJoCo, except for
/// mimic joints, which are constraints there. Rapier treats Coriolis forces half implicitly, an error of
/// first order.
const BARS: [(Engine, f64, f64); 4] = [
    (Engine::Articulated, 1e-5, 1e-9),
    (Engine::Rapier, 1e-5, 1e-4),
    (Engine::Rapier, 1e-7, 2e-6),
    (Engine::Mujoco, 1e-5, 1e-7),
];

#[test]
fn catalogue_panda_accelerates_as_in_pinocchio() {
    let urdf = panda::loaded().entry.unwrap().urdf;
    let vectors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/tests/golden/panda.json");
    let golden = serde_json::from_str(&std::fs::read_to_string(vectors).unwrap()).unwrap();
    agrees("catalogue panda", &ideal(urdf, MimicMode::Follow), &golden);
}

#[test]
fn published_robots_accelerate_as_in_pinocchio() {
    let Some(robots) = robots() else { return };
    for (name, urdf) in
        [("panda", "panda_description/urdf/panda.urdf"), ("ur5", "ur_description/urdf/ur5_robot.urdf")]
    {
        let Some(golden) = vectors(name) else { continue };
        let urdf = std::fs::read_to_string(robots.join(urdf)).unwrap();
        agrees(name, &ideal(&urdf, MimicMode::Independent), &golden);
    }
}

fn agrees(name: &str, model: &Model, golden: &Value) {
    let n = model.nv();
    let order: Vec<usize> = model.joint_names().iter().map(|joint| column(golden, joint)).collect();
    for (engine, dt, bar) in BARS {
        if !engines().any(|here| here == engine) {
            continue;
        }
        let options = Options { contact_iterations: 1, self_collision: false, ..Options::default() };
        let mut simulation = engine.simulate(model.clone(), World::default(), &vec![0.0; n], options);
        let (mut worst, mut count) = (0.0_f64, 0);
        for case in golden["cases"].as_array().unwrap() {
            let pick =
                |key: &str| -> Vec<f64> { order.iter().map(|&i| case[key][i].as_f64().unwrap()).collect() };
            let (q, v, tau, expected) = (pick("q"), pick("v"), pick("tau"), pick("aba"));
            // Stops are not part of forward dynamics: start away from them.
            let inside = (0..n).all(|i| {
                let travel = 10.0 * dt * (v[i].abs() + dt * expected[i].abs());
                q[i] - travel > model.lower()[i] && q[i] + travel < model.upper()[i]
            });
            if inside {
                let found = acceleration(&mut *simulation, &q, &v, &tau, dt);
                worst = worst.max(error(&found, &expected));
                count += 1;
            }
        }
        println!("{name}, {engine:?}, dt {dt:e}: {count} cases, worst relative error {worst:.1e}");
        assert!(count >= 5, "{name}: only {count} cases start inside the limits");
        assert!(worst < bar, "{name}, {engine:?}, dt {dt:e}: {worst:e}");
    }
}

/// Acceleration over one short step under pure effort.
fn acceleration(simulation: &mut dyn Simulator, q: &[f64], v: &[f64], tau: &[f64], dt: f64) -> Vec<f64> {
    simulation.reset(q, v).unwrap();
    for (command, tau) in simulation.commands_mut().iter_mut().zip(tau) {
        *command = JointSetpoint::effort(*tau);
    }
    simulation.step(dt).unwrap();
    simulation.velocities().iter().zip(v).map(|(after, before)| (after - before) / dt).collect()
}

/// Largest difference, relative to the largest entry.
fn error(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected.iter().fold(1e-12_f64, |most, x| most.max(x.abs()));
    found.iter().zip(expected).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs() / scale))
}

/// Column of a joint in the vectors. There are two formats: names only, or records that contain the column.
fn column(golden: &Value, joint: &str) -> usize {
    let joints = golden["joints"].as_array().unwrap();
    let named = |entry: &Value| entry.as_str().or(entry["name"].as_str()) == Some(joint);
    let index = joints.iter().position(named).unwrap();
    joints[index]["idx_v"].as_u64().map_or(index, |column| column as usize)
}

/// The robot without damping, friction and effort limits, which forward dynamics does not model.
fn ideal(urdf: &str, mimic: MimicMode) -> Model {
    let mut text = String::new();
    for tag in urdf.split_inclusive('>') {
        let dynamics = tag.trim_start().starts_with("<dynamics");
        text.push_str(if dynamics { "" } else { tag });
    }
    parse_urdf(&unlimited(&text), None, mimic, &PackagePath::default()).unwrap().model
}

/// Raises every effort limit out of reach.
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

fn vectors(name: &str) -> Option<Value> {
    let folder = std::env::var_os("MOTORIUM_GOLDEN")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/golden"), PathBuf::from);
    let path = folder.join(name).with_extension("json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped {name}: no {}", path.display());
        return None;
    };
    Some(serde_json::from_str(&text).unwrap())
}

pub(crate) fn robots() -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA") {
        return Some(PathBuf::from(folder));
    }
    let script = ["-c", "import sysconfig; print(sysconfig.get_path('purelib'))"];
    let output = Command::new("python3").args(script).output().ok()?;
    let folder = Path::new(String::from_utf8(output.stdout).ok()?.trim())
        .join("cmeel.prefix/share/example-robot-data/robots");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: set MOTORIUM_EXAMPLE_ROBOT_DATA, or pip install --no-deps example-robot-data==6.0.0");
    None
}
