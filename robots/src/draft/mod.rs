//! A draft profile of a robot, derived from its file, for its owner to review and edit.

mod home;

use std::fmt::Write as _;

use nalgebra::{DMatrix, DVector, Vector3};

use home::draft_home;

use crate::configuration::with_joints;
use crate::end_effector::tip_joints;
use crate::{Dynamics, JointKind, Loaded, Model};

/// Deflection at which a drive reaches its full effort, rad or m: 0.2 rad for a revolute joint.
const FULL_EFFORT_AT: [f64; 2] = [0.2, 0.02];
/// Largest sag under the robot's own weight without feed-forward, rad or m.
const LARGEST_SAG: [f64; 2] = [0.05, 0.005];
/// Maximum angular frequency of a drive, 1/s, that steps of 1 ms can follow.
const HIGHEST_FREQUENCY: f64 = 250.0;
/// Lowest one, of a drive without a limit of effort, 1/s.
const LOWEST_FREQUENCY: f64 = 30.0;
/// Speed of a joint without a limit of velocity, rad/s or m/s.
const MODERATE_SPEED: [f64; 2] = [2.0, 0.25];
/// Shortest time from rest to full speed, s.
const SHORTEST_RISE: f64 = 0.1;
/// Fraction of the effort remaining beyond the weight that may accelerate the joint.
const ACCELERATING_PART: f64 = 0.5;
/// Width of a line, in characters.
const WIDTH: usize = 100;

/// Returns a draft profile of `robot` as a TOML text with comments, ready to use.
///
/// The home pose is inside the limits; gains, velocities and accelerations follow from inertias at home and
/// the limits of the robot's file.
///
/// ```
/// # use std::path::Path;
/// use motorium_robots::{Profile, draft_profile, load};
///
/// let arm = load("iiwa14", Path::new("."))?;
/// let profile = Profile::parse(&draft_profile(&arm))?;
/// profile.check(&arm.model)?;
/// assert!(profile.gains(&arm.model)?.kp.iter().all(|kp| *kp > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn draft_profile(robot: &Loaded) -> String {
    let model = &robot.model;
    let (home, moves_freely) = draft_home(model);
    let mut text = head(robot);
    let joints = model.joint_names();
    text += &strings("joints", joints);
    text += "home = \"home\"\n";
    let passive: Vec<String> = (0..joints.len())
        .filter(|&index| is_passive(model, index))
        .map(|index| joints[index].clone())
        .collect();
    if !passive.is_empty() {
        text += "# Joints whose effort limit is 0 in the file: they have no drive. Mend the file if they have one.\n";
        text += &strings("passive", &passive);
    }
    let singular = if moves_freely { ", and away from singular postures" } else { "" };
    let _ = writeln!(
        text,
        "\n[poses]\n# Where the robot starts and rests, rad or m: inside the limits{singular}."
    );
    text += &numbers("home", home.iter().copied());
    for posture in robot.postures.iter().filter(|posture| posture.name != "home") {
        text += &numbers(&key(&posture.name), posture.joints.iter().copied());
    }
    text += &ends(model);
    text += &limits(model, &home);
    text += &gains(model, &home);
    text
}

fn head(robot: &Loaded) -> String {
    let model = &robot.model;
    let file = robot.path.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy());
    let source = file.map_or(model.name().to_string(), |file| file.into_owned());
    let mut text =
        "# A first profile, to be read and edited. Each list has one number for each joint of `joints`.\n"
            .to_string();
    let _ = writeln!(text, "title   = {}", quoted(model.name()));
    let _ = writeln!(text, "sources = [{}]", quoted(&format!("{source}: limits and inertias")));
    if model.base().floating {
        text += "base    = \"floating\"\n";
    }
    text.push('\n');
    text
}

/// End effector of a robot with a fixed base, ends of the limbs of one that moves.
fn ends(model: &Model) -> String {
    let Some(tip) = model.tip() else { return String::new() };
    let frame = &model.frames()[tip.index()].name;
    let (joints, fingers) = tip_joints(model, tip);
    if model.base().floating {
        return format!(
            "\n# A limb that stands on the ground is a foot; name each of them.\n# [feet.NAME]\n# frame  = {}\n# {}",
            quoted(frame),
            strings("joints", &joints).trim_end().replace('\n', "\n# ") + "\n"
        );
    }
    let mut text =
        "\n# The frame that tasks move: the tip of the longest chain of joints.\n[end_effectors.tool]\n"
            .to_string();
    let _ = writeln!(text, "frame  = {}", quoted(frame));
    text += &strings("joints", &joints);
    if !fingers.is_empty() {
        text += &strings("fingers", &fingers);
    }
    text
}

fn limits(model: &Model, home: &DVector<f64>) -> String {
    let joints = 0..model.joint_count();
    let velocity: Vec<f64> = joints.clone().map(|index| speed(model, index)).collect();
    let at = Weights::at_home(model, home);
    let acceleration = joints.map(|index| {
        let effort = model.effort_limit()[index];
        let left = effort - at.gravity[index].abs();
        let reached = velocity[index] / SHORTEST_RISE;
        match effort.is_finite() && left > 0.0 {
            true => rounded((ACCELERATING_PART * left / at.inertia[index]).min(reached)),
            false => rounded(reached),
        }
    });
    let mut text = "\n[limits]\n# Speeds of the file, rad/s or m/s; moderate ones where it has none. Lower ones are kept by all components.\n".to_string();
    text += &numbers("velocity", velocity.iter().copied());
    text += "# Half of the effort that the weight at home leaves, by the inertia there, rad/s^2 or m/s^2; full speed not\n# before 0.1 s. `inf` for none.\n";
    text + &numbers("acceleration", acceleration)
}

fn gains(model: &Model, home: &DVector<f64>) -> String {
    let at = Weights::at_home(model, home);
    let pairs: Vec<(f64, f64)> = (0..model.joint_count())
        .map(|index| {
            if is_passive(model, index) {
                return (0.0, 0.0);
            }
            let slides = usize::from(model.joint(index).kind == JointKind::Prismatic);
            let (effort, free) = (model.effort_limit()[index], at.free_inertia[index]);
            let wanted = match effort.is_finite() {
                true => effort / FULL_EFFORT_AT[slides],
                false => (at.inertia[index] * LOWEST_FREQUENCY.powi(2))
                    .max(at.gravity[index].abs() / LARGEST_SAG[slides]),
            };
            let kp = rounded(wanted.min(free * HIGHEST_FREQUENCY.powi(2)));
            let critical = 2.0 * (kp * at.inertia[index]).sqrt();
            (kp, rounded(critical.min(2.0 * free * HIGHEST_FREQUENCY)))
        })
        .collect();
    let mut text = "\n# Stiffness, N m/rad or N/m: the full effort at a deflection of 0.2 rad or 20 mm, less where little inertia follows.\n# Damping, N m s/rad or N s/m: critical for the inertia at home.\n[gains]\n".to_string();
    text += &numbers("kp", pairs.iter().map(|pair| pair.0));
    text + &numbers("kd", pairs.iter().map(|pair| pair.1))
}

/// Inertias and weights at a posture.
struct Weights {
    /// Inertia that each joint moves while the others are fixed, kg m^2 or kg.
    inertia: Vec<f64>,
    /// Inertia at each joint while the others are free.
    free_inertia: Vec<f64>,
    /// Effort that holds it against gravity, N m or N.
    gravity: Vec<f64>,
}

impl Weights {
    fn at_home(model: &Model, home: &DVector<f64>) -> Self {
        let q = with_joints(model, home.as_slice());
        let (nv, first) = (model.nv(), model.nv() - model.joint_count());
        let mut dynamics = Dynamics::new(model);
        let mut mass = DMatrix::zeros(nv, nv);
        dynamics.crba(model, &q, &mut mass);
        let mut gravity = vec![0.0; nv];
        dynamics.gravity(model, &q, Vector3::new(0.0, 0.0, -9.81), &mut gravity);
        // Links without a mass count for little.
        let least = 1e-6;
        let inertia: Vec<f64> = (first..nv).map(|index| mass[(index, index)].max(least)).collect();
        let inverse = mass.clone().try_inverse();
        let free_inertia = (first..nv)
            .zip(&inertia)
            .map(|(index, fallback)| {
                let free = inverse.as_ref().map(|inverse| 1.0 / inverse[(index, index)]);
                free.filter(|free| *free > least && free.is_finite()).unwrap_or(*fallback)
            })
            .collect();
        Self { inertia, free_inertia, gravity: gravity[first..].to_vec() }
    }
}

fn is_passive(model: &Model, index: usize) -> bool {
    model.effort_limit()[index] == 0.0
}

fn speed(model: &Model, index: usize) -> f64 {
    let limit = model.velocity_limit()[index];
    let slides = usize::from(model.joint(index).kind == JointKind::Prismatic);
    if limit.is_finite() && limit > 0.0 { limit } else { MODERATE_SPEED[slides] }
}

/// A number with two digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A key of a table, in quotes where it needs them.
fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.to_string() } else { quoted(name) }
}

fn strings(key: &str, values: &[String]) -> String {
    list(key, values.iter().map(|value| quoted(value)))
}

fn numbers(key: &str, values: impl Iterator<Item = f64>) -> String {
    list(
        key,
        values.map(|value| match value {
            value if value.is_infinite() => "inf".to_string(),
            value => format!("{:?}", (value * 1e6).round() / 1e6),
        }),
    )
}

/// A key with a list, over several lines where it is long.
fn list(key: &str, values: impl Iterator<Item = String>) -> String {
    let values: Vec<String> = values.collect();
    let inline = format!("{key} = [{}]\n", values.join(", "));
    if inline.len() <= WIDTH {
        return inline;
    }
    let mut text = format!("{key} = [\n");
    let mut line = String::new();
    for value in values {
        if !line.is_empty() && line.len() + value.len() + 2 > WIDTH - 4 {
            let _ = writeln!(text, "    {}", line.trim_end());
            line.clear();
        }
        let _ = write!(line, "{value}, ");
    }
    let _ = writeln!(text, "    {}\n]", line.trim_end());
    text
}
