//! Distances between the links of the Panda, for different collision geometries.

use std::path::Path;

use criterion::Criterion;
use motorium_robots::{
    CollisionModel, CollisionOptions, Collisions, Kinematics, LoadOptions, MeshMode, Model, load, load_with,
};

/// States in the ring.
const STATES: usize = 16;

/// Range of the distances that a controller requires \[m\].
const RANGE: f64 = 0.1;

/// One robot with its solids.
struct Subject {
    name: &'static str,
    model: Model,
    solids: CollisionModel,
}

/// Returns the Panda of the catalogue (primitives), and the published one with meshes as capsules, as convex
/// hulls and unchanged, from the folder `MOTORIUM_EXAMPLE_ROBOT_DATA` (see `robots.rs`).
fn subjects() -> Vec<Subject> {
    let options = CollisionOptions::default();
    let mut subjects = Vec::new();
    if let Ok(robot) = load("panda", Path::new("."))
        && let Ok(solids) = CollisionModel::new(&robot.model, &options)
    {
        subjects.push(Subject { name: "primitives", model: robot.model, solids });
    }
    let Some(folder) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA").map(std::path::PathBuf::from) else {
        eprintln!("left out capsules, hulls and meshes: set MOTORIUM_EXAMPLE_ROBOT_DATA");
        return subjects;
    };
    let mut load_options = LoadOptions::default();
    load_options.packages.folders = folder.ancestors().map(Path::to_owned).collect();
    let modes =
        [("capsules", MeshMode::Capsule), ("hulls", MeshMode::default()), ("triangles", MeshMode::Surface)];
    for (name, meshes) in modes {
        let made = load_with("panda_description/urdf/panda.urdf", &folder, &load_options)
            .map_err(|error| error.to_string())
            .and_then(|robot| {
                let options = CollisionOptions { meshes, ..options.clone() };
                let solids =
                    CollisionModel::new(&robot.model, &options).map_err(|error| error.to_string())?;
                Ok(Subject { name, model: robot.model, solids })
            });
        match made {
            Ok(subject) => subjects.push(subject),
            Err(error) => eprintln!("left out {name}: {error}"),
        }
    }
    subjects
}

/// Measures the distance of every pair, the nearest pair, and the pairs in range, each with the required
/// poses.
pub(crate) fn measure(criterion: &mut Criterion) {
    for Subject { name, model, solids } in &subjects() {
        let states: Vec<Vec<f64>> = (0..STATES).map(|state| configuration(model, state)).collect();
        let (mut kinematics, mut collisions) = (Kinematics::new(model), Collisions::new(solids));
        let mut group = criterion.benchmark_group(format!("distances/{name}/{} pairs", solids.pairs().len()));
        let mut next = 0;
        let mut place = |kinematics: &mut Kinematics, collisions: &mut Collisions| {
            next = (next + 1) % STATES;
            kinematics.update(model, &states[next]);
            collisions.update(solids, kinematics);
        };
        group.bench_function("all", |timer| {
            timer.iter(|| {
                place(&mut kinematics, &mut collisions);
                (0..solids.pairs().len())
                    .map(|pair| collisions.distance(solids, pair).distance)
                    .fold(f64::INFINITY, f64::min)
            });
        });
        group.bench_function("nearest", |timer| {
            timer.iter(|| {
                place(&mut kinematics, &mut collisions);
                collisions.nearest(solids).map(|proximity| proximity.distance)
            });
        });
        group.bench_function("within 0.1 m", |timer| {
            timer.iter(|| {
                place(&mut kinematics, &mut collisions);
                collisions.within(solids, RANGE).len()
            });
        });
        group.finish();
    }
}

/// Configurations of a slow motion through the joint ranges; a step corresponds to a few milliseconds.
fn configuration(model: &Model, state: usize) -> Vec<f64> {
    let (lower, upper) = (model.lower(), model.upper());
    let along = |joint: usize| {
        let phase = std::f64::consts::TAU * state as f64 / STATES as f64 + joint as f64;
        0.5 * (lower[joint] + upper[joint]) + 0.2 * (upper[joint] - lower[joint]) * phase.sin()
    };
    (0..model.nq()).map(along).collect()
}
