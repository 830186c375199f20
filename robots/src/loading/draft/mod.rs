//! Draft profiles of robots, for review and editing.

mod drives;
mod home;
mod limbs;
mod stance;
mod text;
mod wheels;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use nalgebra::DVector;

use drives::{gains, is_passive, limits};
use home::draft_home;
use limbs::{Limb, Limbs};
use stance::{Contact, Stance, stand};
use text::{base_pose, key, numbers, quoted, rounded, strings};
use wheels::Wheels;

use crate::model::configuration::with_joints;
use crate::{BaseMode, Kinematics, Loaded, Model};

/// Returns a draft of the profile of `robot` (its poses, gains, feet and end effectors): a commented TOML
/// text that is ready to use.
///
/// The home pose is inside the limits. Gains, velocities and accelerations are computed from the inertias in
/// the home pose and the limits in the robot's file. Feet and end effectors are taken from the SRDF in the
/// folder of the file or, without an SRDF, from the names of the links.
///
/// For a robot with at least two feet, the function searches for a standing posture. If it finds one, the
/// profile has a floating base, and the home pose is this posture. With [`Fixed`](BaseMode::Fixed), the base
/// is fixed even if there is a standing posture. A comment in the text states the reason for the choice. A
/// pair of wheels on one axle becomes the table `[mobile_base]`, and other links that reach the ground become
/// feet without friction; both are commented out if the base is fixed.
///
/// ```
/// # use std::path::Path;
/// use motorium_robots::{BaseMode, Profile, draft_profile, load};
///
/// let arm = load("iiwa14", Path::new("."))?;
/// let profile = Profile::parse(&draft_profile(&arm, BaseMode::AsFile))?;
/// profile.check(&arm.model)?;
/// assert!(profile.gains(&arm.model)?.kp.iter().all(|kp| *kp > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn draft_profile(robot: &Loaded, base: BaseMode) -> String {
    let model = &robot.model;
    let limbs = Limbs::of_robot(robot);
    let legged = !limbs.feet.is_empty() && base != BaseMode::Fixed;
    let stance = legged.then(|| stand(robot, &limbs.feet));
    let (stance, falls) = match stance {
        Some(Ok(stance)) => (Some(stance), None),
        Some(Err(falls)) => (None, Some(falls)),
        None => (None, None),
    };
    let (home, moves_freely) = match &stance {
        Some(stance) => (stance.joints.clone(), false),
        None => draft_home(model),
    };
    let mut text = head(robot);
    if let Some(stance) = &stance {
        let _ = writeln!(text, "# It stands on its {} feet: the root link moves freely.", stance.feet.len());
        text += "base    = \"floating\"\n";
    } else if model.base().floating {
        text += "base    = \"floating\"\n";
    }
    if let Some(falls) = &falls {
        let base = if model.base().floating { "It does not stand" } else { "The base is fixed" };
        let _ = writeln!(text, "# {base}: {falls}.");
    }
    text.push('\n');
    let joints = model.joint_names();
    text += &strings("joints", joints);
    text += "home = \"home\"\n";
    let passive: Vec<String> = (0..joints.len())
        .filter(|&index| is_passive(model, index))
        .map(|index| joints[index].clone())
        .collect();
    if !passive.is_empty() {
        text += "# Joints with an effort limit of 0 in the file: they have no drive. If they do have one, fix the file.\n";
        text += &strings("passive", &passive);
    }
    text += &poses(robot, &home, moves_freely, stance.as_ref());
    match &stance {
        Some(stance) => text += &feet(model, stance),
        None => {
            for foot in &limbs.feet {
                text += &commented_foot(model, foot);
            }
        }
    }
    text += &ends(model, &limbs);
    let wheels = Wheels::find(model).filter(|_| stance.is_none());
    if let Some(wheels) = &wheels {
        text += &wheels.text(model);
    }
    let holding = stance.as_ref().map(|stance| stance.effort.as_slice());
    text += &limits(model, &home, holding, wheels.as_ref());
    text += &gains(model, &home, holding, wheels.as_ref());
    text
}

fn head(robot: &Loaded) -> String {
    let model = &robot.model;
    let file = robot.path.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy());
    let source = file.map_or(model.name().to_string(), |file| file.into_owned());
    let mut text =
        "# A draft profile, for review and editing. Each list has one number per joint of `joints`.\n"
            .to_string();
    let _ = writeln!(text, "title   = {}", quoted(model.name()));
    let _ = writeln!(text, "sources = [{}]", quoted(&format!("{source}: limits and inertias")));
    text
}

/// Writes the home pose, the states of the SRDF, and the base of a robot that stands.
fn poses(robot: &Loaded, home: &DVector<f64>, moves_freely: bool, stance: Option<&Stance>) -> String {
    let model = &robot.model;
    let reason = match (stance, moves_freely) {
        (Some(Stance { state: Some(state), .. }), _) => {
            format!(
                "like {state:?} of the SRDF, with all feet\n# on the ground and the centre of mass above them"
            )
        }
        (Some(_), _) => {
            "inside the limits, with all feet on the\n# ground and the centre of mass above them".into()
        }
        (None, true) => "inside the limits, and away from singular postures".into(),
        (None, false) => "inside the limits".into(),
    };
    let mut text = format!("\n[poses]\n# Start and rest posture, rad or m: {reason}.\n");
    text += &numbers("home", home.iter().copied());
    let others = || robot.postures.iter().filter(|posture| posture.name != "home");
    for posture in others() {
        text += &numbers(&key(&posture.name), posture.joints.iter().copied());
    }
    let Some(stance) = stance else { return text };
    text += "\n# Base with the lowest foot on the ground, m and rad.\n[base_poses]\n";
    text += &base_pose("home", &stance.base);
    let mut kinematics = Kinematics::new(model);
    for posture in others() {
        let mut lowest = |joints: &DVector<f64>| {
            kinematics.update(model, &with_joints(model, joints.as_slice()));
            let feet = stance.feet.iter().map(|foot| kinematics.pose(model, foot.limb.frame).translation.z);
            feet.fold(f64::INFINITY, f64::min)
        };
        let mut base = stance.base;
        base.translation.z += lowest(home) - lowest(&posture.joints);
        text += &base_pose(&key(&posture.name), &base);
    }
    text
}

fn feet(model: &Model, stance: &Stance) -> String {
    let mut text = String::new();
    let mut names = Names::default();
    for foot in &stance.feet {
        let frame = &model.frames()[foot.limb.frame.index()].name;
        let _ = writeln!(text, "\n[feet.{}]\nframe  = {}", names.unique(&foot.limb.name), quoted(frame));
        text += &strings("joints", &foot.limb.joints);
        match foot.contact {
            Contact::Ball { radius: 0.0 } => {}
            Contact::Ball { radius } => {
                let _ = writeln!(text, "radius = {}", rounded(radius));
            }
            Contact::Sole { sides: [x, y], height } => {
                if height > 1e-3 {
                    let _ =
                        writeln!(text, "# The sole is {:.0} mm below the origin of the frame.", 1e3 * height);
                }
                let _ = writeln!(text, "sole   = [{}, {}]", rounded(x), rounded(y));
            }
        }
    }
    text
}

fn commented_foot(model: &Model, foot: &Limb) -> String {
    let frame = &model.frames()[foot.frame.index()].name;
    let mut text = format!("\n[feet.{}]\nframe  = {}\n", key(&foot.name), quoted(frame));
    text += &strings("joints", &foot.joints);
    text.trim_end()
        .lines()
        .map(|line| if line.is_empty() { "\n".into() } else { format!("# {line}\n") })
        .collect()
}

/// Writes the end effectors.
fn ends(model: &Model, limbs: &Limbs) -> String {
    let mut text = String::new();
    let source = if limbs.from_srdf { "by the SRDF" } else { "the tip of the longest chain of joints" };
    let mut names = Names::default();
    for (index, tool) in limbs.tools.iter().enumerate() {
        text.push('\n');
        if index == 0 {
            let _ = writeln!(text, "# Frames that tasks move: {source}.");
        }
        let frame = &model.frames()[tool.frame.index()].name;
        let _ = writeln!(text, "[end_effectors.{}]\nframe  = {}", names.unique(&tool.name), quoted(frame));
        text += &strings("joints", &tool.joints);
        if !tool.fingers.is_empty() {
            text += &strings("fingers", &tool.fingers);
        }
    }
    text
}

/// Unique keys of tables.
#[derive(Default)]
struct Names(BTreeSet<String>);

impl Names {
    fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_owned();
        while !self.0.insert(unique.clone()) {
            unique.push('_');
        }
        key(&unique)
    }
}
