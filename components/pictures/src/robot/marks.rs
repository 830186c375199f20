//! Marks drawn over the robot: frames, and the centre of mass.

use std::collections::BTreeSet;

use motorium_robots::{Kinematics, Loaded};
use nalgebra::{Isometry3, Vector3};

/// Selection of the frames that are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// The frame of the root, and the frames of end effectors, feet and rotors. If the robot has no profile,
    /// the frame of the root and the frame of the last link of every chain.
    Ends,
    /// The frames of the links that joints move.
    Joints,
    /// Every frame of the model.
    All,
    /// No frame.
    None,
}

/// Frames and the centre of mass, drawn over a robot.
#[derive(Debug, Clone)]
pub struct Marks {
    /// Names and poses of the frames.
    pub(super) frames: Vec<(String, Isometry3<f64>)>,
    /// Label the frames with their names.
    pub(super) names: bool,
    /// Position of the centre of mass \[m\].
    pub(super) com: Option<Vector3<f64>>,
}

impl Marks {
    /// Creates the marks of a robot at the poses in `kinematics`: the selected frames, labelled if `names`,
    /// and the centre of mass if `com`.
    pub fn new(robot: &Loaded, kinematics: &Kinematics, frames: Frames, names: bool, com: bool) -> Self {
        Self {
            frames: self::frames(robot, kinematics, frames),
            names,
            com: com.then(|| kinematics.centre_of_mass(&robot.model).position),
        }
    }
}

/// Returns the requested frames and their poses.
fn frames(robot: &Loaded, kinematics: &Kinematics, wanted: Frames) -> Vec<(String, Isometry3<f64>)> {
    let model = &robot.model;
    let names: BTreeSet<&str> = match wanted {
        Frames::None => BTreeSet::new(),
        Frames::All => model.frames().iter().map(|frame| frame.name.as_str()).collect(),
        Frames::Joints => model.bodies().iter().map(|body| body.name.as_str()).collect(),
        Frames::Ends => ends(robot),
    };
    let frame = |name: &str| {
        let id = model.frame(name).ok()?;
        Some((name.to_string(), kinematics.pose(model, id)))
    };
    names.into_iter().filter_map(frame).collect()
}

/// Returns the root and the links named in the profile, or else the last link of every chain.
fn ends(robot: &Loaded) -> BTreeSet<&str> {
    let model = &robot.model;
    let mut names: BTreeSet<&str> =
        model.frames().first().map(|frame| frame.name.as_str()).into_iter().collect();
    match &robot.profile {
        Some(profile) => {
            names.extend(profile.end_effectors.values().map(|end| end.frame.as_str()));
            names.extend(profile.feet.values().map(|foot| foot.frame.as_str()));
            names.extend(profile.rotors.values().map(|rotor| rotor.frame.as_str()));
            names.extend(profile.mobile_base.iter().map(|base| base.frame.as_str()));
        }
        None => {
            let carries = |index: usize| model.bodies().iter().any(|body| body.parent == Some(index));
            for index in (0..model.bodies().len()).filter(|index| !carries(*index)) {
                let last = model.frames().iter().rev().find(|frame| frame.body == Some(index));
                names.extend(last.map(|frame| frame.name.as_str()));
            }
        }
    }
    names
}
