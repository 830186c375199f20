//! Robot settings in a graph file that override the profile: moving joints, frame, start and gains.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::loading::end_effector::tip_joints;
use crate::loading::joint_subset::JointSubset;
use crate::profile::GainArrays;
use crate::{BaseKind, EndEffector, Loaded, Model, PerJoint, Profile, SettingError};

/// Settings of a robot in a graph file.
pub(crate) struct Settings {
    subset: JointSubset,
    /// Frame that tasks control.
    frame: Option<String>,
    start: Option<Start>,
    gains: Option<GivenGains>,
}

/// The start configuration, which is also the home pose.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a pose, one number for all joints, or a list with one number per joint"
)]
enum Start {
    Pose(String),
    Position(PerJoint),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenGains {
    kp: Option<PerJoint>,
    kd: Option<PerJoint>,
}

impl Settings {
    /// Reads the settings of a table with the keys `joints`, `fixed`, `frame`, `start` and `gains`.
    pub(crate) fn read(table: &Value) -> Result<Self, SettingError> {
        let fixed = read(table, "fixed")?.unwrap_or_default();
        Ok(Self {
            subset: JointSubset { joints: read(table, "joints")?, fixed },
            frame: read(table, "frame")?,
            start: read(table, "start")?,
            gains: read(table, "gains")?,
        })
    }

    /// Holds joints, and modifies the robot's profile, or creates one if required.
    pub(crate) fn apply(self, robot: &mut Loaded) -> Result<(), SettingError> {
        let pose = match &self.start {
            Some(Start::Pose(name)) => Some(name.as_str()),
            _ => None,
        };
        self.subset.apply(robot, pose)?;
        if self.frame.is_none() && self.start.is_none() && self.gains.is_none() {
            return Ok(());
        }
        let model = &robot.model;
        let mut profile = robot.profile.take().unwrap_or_else(|| without_poses(model));
        if let Some(given) = self.gains {
            set_gains(&mut profile, given, model)?;
        }
        match self.start {
            None => {}
            Some(Start::Pose(name)) => {
                profile.pose(model, &name).map_err(|error| SettingError::new("start", error))?;
                profile.home = name;
            }
            Some(Start::Position(position)) => set_start(&mut profile, &position, model)?,
        }
        if let Some(frame) = self.frame {
            set_frame(&mut profile, frame, model)?;
        }
        robot.profile = Some(profile);
        Ok(())
    }
}

fn read<T: DeserializeOwned>(table: &Value, key: &'static str) -> Result<Option<T>, SettingError> {
    let value = table.get(key).filter(|value| !value.is_null()).cloned();
    value
        .map(|value| serde_json::from_value(value).map_err(|error| SettingError::new(key, error)))
        .transpose()
}

/// Creates a profile for a robot without one: its home pose is zero, or the nearest limit.
fn without_poses(model: &Model) -> Profile {
    let mut profile = Profile::empty();
    profile.title = model.name().to_owned();
    profile.joints = model.joint_names().to_vec();
    if model.base().floating {
        profile.base = BaseKind::Floating;
    }
    let limits = model.lower().iter().zip(model.upper().iter());
    let zero = limits.map(|(lower, upper)| 0.0_f64.max(*lower).min(*upper)).collect();
    profile.home = "zero".to_owned();
    profile.poses = BTreeMap::from([(profile.home.clone(), PerJoint::Each(zero))]);
    profile
}

/// Expands numbers in the order of the model's joints to a list of the profile.
fn listed(profile: &Profile, model: &Model, values: &[f64]) -> PerJoint {
    let of = |joint: &String| model.joint_index(joint).map_or(0.0, |index| values[index]);
    PerJoint::Each(profile.joints.iter().map(of).collect())
}

/// Expands to one number per joint of the model, in order.
fn resolved(given: &PerJoint, key: &'static str, model: &Model) -> Result<Vec<f64>, SettingError> {
    given.resolve(model.joint_count()).map_err(|error| {
        SettingError::new(key, format!("{error}, in this order: {}", model.joint_names().join(", ")))
    })
}

fn set_gains(profile: &mut Profile, given: GivenGains, model: &Model) -> Result<(), SettingError> {
    let of = |given: Option<PerJoint>, name: &str, known: Option<PerJoint>| {
        let Some(given) = given else {
            let message = format!("`{name}` is missing, and the robot has no profile with gains");
            return known.ok_or_else(|| SettingError::new("gains", message));
        };
        let values = resolved(&given, "gains", model)?;
        match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(value) => {
                let message = format!("`{name}` has {value}, expected a finite number of at least 0");
                Err(SettingError::new("gains", message))
            }
            None => Ok(listed(profile, model, &values)),
        }
    };
    let (known_kp, known_kd) = profile.gains.clone().map(|GainArrays { kp, kd }| (kp, kd)).unzip();
    let (kp, kd) = (of(given.kp, "kp", known_kp)?, of(given.kd, "kd", known_kd)?);
    profile.gains = Some(GainArrays { kp, kd });
    Ok(())
}

/// Name of the pose that a graph specifies by numbers.
const START: &str = "start";

fn set_start(profile: &mut Profile, position: &PerJoint, model: &Model) -> Result<(), SettingError> {
    let values = resolved(position, START, model)?;
    for (index, value) in values.iter().enumerate() {
        let (lower, upper) = (model.lower()[index], model.upper()[index]);
        if !(lower..=upper).contains(value) {
            let joint = &model.joint_names()[index];
            let message = format!("joint `{joint}` starts at {value}, outside its limits {lower} to {upper}");
            let advice = model.degrees_advice(index, *value).map(|advice| format!("; {advice}"));
            return Err(SettingError::new(START, message + advice.as_deref().unwrap_or_default()));
        }
    }
    if let Some(base) = profile.base_poses.get(&profile.home).copied() {
        profile.base_poses.insert(START.to_owned(), base);
    }
    profile.poses.insert(START.to_owned(), listed(profile, model, &values));
    profile.home = START.to_owned();
    Ok(())
}

fn set_frame(profile: &mut Profile, frame: String, model: &Model) -> Result<(), SettingError> {
    let id = model.end_effector(None, Some(&frame)).map_err(|error| SettingError::new("frame", error))?;
    profile.end_effectors.retain(|_, end| end.frame == frame);
    if profile.end_effectors.is_empty() {
        let (joints, fingers) = tip_joints(model, id);
        profile.end_effectors.insert("tool".to_owned(), EndEffector { frame, joints, fingers });
    }
    Ok(())
}
