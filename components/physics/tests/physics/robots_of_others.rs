//! Every robot of the PyPI package `example-robot-data` holds its pose or stands for 2 s, with collision
//! shapes, using only the gains of its first profile. Skipped, with the reason, if the package is not
//! installed.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use motorium::state::MAX_JOINTS;
use motorium_physics::{
    ArticulatedSimulator, BuildWarning, JointSetpoint, Options, RobotSetup, Simulator, World,
};
use motorium_robots::{
    BaseMode, Dynamics, JointKind, LoadOptions, Loaded, Profile, ShapeSource, draft_profile, load_with,
};
use nalgebra::{DVector, Vector3};

use crate::first_step::robots;
use crate::legged::grounded;

/// Robots that stand on the ground, by the prefixes of their paths: quadrupeds, and bipeds whose posture from
/// the manufacturer balances on flat feet. All others hold their pose with a fixed base: arms, hands, mobile
/// bases without a floating joint, flying arms, and humanoids without a balanced posture.
const STANDING: [&str; 15] = [
    "a1_",
    "anymal_",
    "b1_",
    "centauro_",
    "go1_",
    "go2_",
    "hector_",
    "hyq_",
    "icub_description/robots/icub.urdf",
    "iris_",
    "laikago_",
    "quadruped_",
    "solo_",
    "talos_data/robots/talos_full",
    "talos_data/robots/talos_reduced",
];

/// Robots that fail, with a part of the reason.
const FAILING: [(&str, &str); 7] = [
    // A defect of the file: the leader of a mimic joint has another name.
    ("alex_psyonic_hands.urdf", "mimics \"index_q1\", which does not exist"),
    // Expanded from a xacro file without an argument: it is empty.
    ("ur_description/urdf/ur3.urdf", "the robot has no <link>"),
    // Messages have room for 64 joints.
    ("tiago_dual.urdf", "101 joints, at most 64 fit"),
    // Springs support the arms of the real robot; its drives alone are too weak.
    ("pr2.urdf", "joints moved by 1.1e0 (r_shoulder_lift_joint)"),
    // The drive of its waist has 30 N m, for a robot of 104 kg.
    ("simple_humanoid.urdf", "joints moved by 1.3e0 (WAIST_P)"),
    // It has neither collision shapes nor visuals.
    ("simple_humanoid_classical.urdf", "no shape to collide with"),
    // A body without joints, whose hull rests on its side.
    ("quadrotor_base.urdf", "tilted 0.4"),
];

#[test]
fn package_robots_hold_or_stand_except_known_ones() {
    let Some(folder) = robots() else { return };
    let mut files = Vec::new();
    find(&folder, &mut files);
    files.sort();
    let (next, outcomes) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let name = file.strip_prefix(&folder).unwrap().display().to_string();
                    let outcome = trial(file, &name);
                    outcomes.lock().unwrap().push((name, outcome));
                }
            });
        }
    });
    let mut outcomes = outcomes.into_inner().unwrap();
    outcomes.sort();
    let mut surprises = Vec::new();
    for (name, outcome) in &outcomes {
        let known = FAILING.iter().find(|(file, _)| name.ends_with(file));
        match (outcome, known) {
            (Ok(what), None) => println!("ok    {name}: {what}"),
            (Err(reason), Some((_, expected))) if reason.contains(expected) => {
                println!("known {name}: {reason}")
            }
            (outcome, _) => surprises.push(format!("{name}: {outcome:?}")),
        }
    }
    let passed = outcomes.iter().filter(|(_, outcome)| outcome.is_ok()).count();
    println!("{passed} of {}", outcomes.len());
    assert!(surprises.is_empty(), "{}", surprises.join("\n"));
    assert!(passed >= 60, "{passed} of {}", outcomes.len());
}

/// Simulates two seconds and returns the text of the measurement, or the reason of the failure.
fn trial(file: &Path, name: &str) -> Result<String, String> {
    let free = STANDING.iter().any(|start| name.starts_with(start));
    let base = if free { BaseMode::Floating } else { BaseMode::AsFile };
    let options = LoadOptions { base, ..LoadOptions::default() };
    let open = |shapes| {
        let options = LoadOptions { shapes, ..options.clone() };
        load_with(file.to_str().unwrap(), Path::new(""), &options).map_err(|error| error.to_string())
    };
    let mut robot = open(ShapeSource::Collision)?;
    let bare = shapes(&robot) == 0;
    if bare {
        // As in `motorium robot hulls`: the visual shapes are used for collision.
        robot = open(ShapeSource::Visual)?;
    }
    let (count, joints) = (shapes(&robot), robot.model.joint_count());
    if count == 0 {
        return Err("no shape to collide with".into());
    }
    if joints > MAX_JOINTS {
        return Err(format!("{joints} joints, at most {MAX_JOINTS} fit"));
    }
    let source = if bare { "visuals" } else { "shapes" };
    // Links without inertia need the inertia of the drives' rotors, which URDF files do not contain.
    let held = held(&robot, 0.0).or_else(|first| {
        let more = held(&robot, ARMATURE).map_err(|second| {
            if second == first { first } else { format!("{first}; with an armature {second}") }
        });
        more.map(|words| format!("with an armature {words}"))
    });
    held.map(|words| format!("{count} {source}, {words}"))
}

/// Inertia of a rotor at its joint \[kg m2\].
const ARMATURE: f64 = 0.01;

fn shapes(robot: &Loaded) -> usize {
    let model = &robot.model;
    model.base().shapes.len() + model.bodies().iter().map(|body| body.shapes.len()).sum::<usize>()
}

/// Holds a robot for two seconds.
fn held(robot: &Loaded, armature: f64) -> Result<String, String> {
    let (model, free) = (&robot.model, robot.model.base().floating);
    let profile =
        Profile::parse(&draft_profile(robot, BaseMode::AsFile)).map_err(|error| error.to_string())?;
    let q = start(robot, &profile);
    let setup = RobotSetup::from_loaded(robot).map_err(|error| error.to_string())?;
    let world = if free { grounded(vec![]) } else { World::default() };
    let options = Options { armature, ..Options::default() };
    let simulation = ArticulatedSimulator::new(setup, world, q.as_slice(), options);
    let mut simulation = simulation.map_err(|error| error.to_string())?;
    let ignored = simulation.warnings().iter().find(|one| matches!(one, BuildWarning::ShapeIgnored { .. }));
    if let Some(warning) = ignored {
        return Err(warning.to_string());
    }
    // Not from rest, because a balanced fixed robot would not move at all.
    let v: Vec<f64> =
        (0..model.nv()).map(|i| if free { 0.0 } else { 0.02 * (1.0 + i as f64).sin() }).collect();
    simulation.reset(q.as_slice(), &v).map_err(|error| error.to_string())?;
    simulation.place_on_ground();
    hold(&mut simulation, &profile);
    let (before, pose) = (simulation.positions().to_vec(), simulation.base_pose());
    for _ in 0..2000 {
        simulation.step(1e-3).map_err(|error| error.to_string())?;
    }
    let mut worst = (0.0, String::new());
    for (index, (now, before)) in simulation.positions().iter().zip(&before).enumerate() {
        // A joint without a drive hangs freely; a prismatic joint is measured in centimetres.
        let driven = model.effort_limit()[index] != 0.0;
        let scale = if model.joint(index).kind == JointKind::Prismatic { 10.0 } else { 1.0 };
        let moved = scale * (now - before).abs();
        if driven && (moved > worst.0 || !moved.is_finite()) {
            worst = (moved, model.joint_names()[index].clone());
        }
    }
    let now = simulation.base_pose();
    let sunk = pose.translation.z - now.translation.z;
    let tilt = (now.rotation * Vector3::z()).angle(&(pose.rotation * Vector3::z()));
    let mut words = format!("joints moved by {:.1e} ({})", worst.0, worst.1);
    if free {
        words += &format!(", sunk {sunk:.4} m, tilted {tilt:.4} rad");
    }
    let bound = if free { 0.2 } else { 0.05 };
    let stands = !free || (sunk.abs() < 0.1 && tilt < 0.3 && simulation.contact_force().z > 0.0);
    if worst.0 < bound && stands { Ok(words) } else { Err(words) }
}

/// The manufacturer's named posture, or the posture of the profile, within the limits.
fn start(robot: &Loaded, profile: &Profile) -> DVector<f64> {
    let model = &robot.model;
    let named = ["standing", "half_sitting", "homing_nominal", "default", "home", "neutral"];
    let posture = named.iter().find_map(|name| robot.postures.iter().find(|one| one.name.starts_with(name)));
    let Some(posture) = posture else { return profile.configuration(model, &profile.home).unwrap() };
    let mut q = posture.configuration(model);
    let offset = q.len() - model.joint_count();
    for index in 0..model.joint_count() {
        q[offset + index] = q[offset + index].clamp(model.lower()[index], model.upper()[index]);
    }
    q
}

/// Deflection at which a drive of a standing robot produces its full effort \[rad\], and the damping, as a
/// time \[s\]. The drive is stiffer than in a first profile, which accounts for feet in the air.
const STIFF: [f64; 2] = [0.02, 0.02];

/// Holds the posture: a fixed-base robot by the gains of its first profile with gravity feed-forward, a
/// standing robot by stiff drives.
fn hold(simulation: &mut ArticulatedSimulator, profile: &Profile) {
    let model = simulation.model().clone();
    let (q, home) = (simulation.configuration().to_vec(), simulation.positions().to_vec());
    let gains = profile.gains(&model).unwrap();
    let free = model.base().floating;
    let mut weight = vec![0.0; model.nv()];
    if !free {
        Dynamics::new(&model).gravity(&model, &q, Vector3::new(0.0, 0.0, -9.81), &mut weight);
    }
    let first = model.nv() - model.joint_count();
    for (index, command) in simulation.commands_mut().iter_mut().enumerate() {
        let effort = model.effort_limit()[index];
        let (kp, kd) = match free && effort > 0.0 && effort.is_finite() {
            true => (effort / STIFF[0], effort / STIFF[0] * STIFF[1]),
            false => (gains.kp[index], gains.kd[index]),
        };
        *command = JointSetpoint::hold(home[index], kp, kd);
        command.effort = weight[first + index];
    }
}

fn find(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "urdf") {
            found.push(path);
        }
    }
}
