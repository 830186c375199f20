//! What a URDF does not say of a robot: poses, end effectors, gains. One TOML file beside the URDF.

use std::collections::BTreeMap;

use nalgebra::DVector;
use serde::Deserialize;

use crate::nearest::{nearest, suggestion};
use crate::{Model, UnknownFrame};

/// Poses, end effectors and gains of one robot. Arrays follow `joints`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// What the robot is called in print.
    pub title: String,
    /// Where the numbers come from.
    pub sources: Vec<String>,
    /// Independent joints, in the order of every array below.
    pub joints: Vec<String>,
    /// Name of the pose in `poses` to start from.
    pub home: String,
    /// Named configurations \[rad or m\].
    pub poses: BTreeMap<String, Vec<f64>>,
    /// Named end effectors.
    #[serde(default)]
    pub end_effectors: BTreeMap<String, EndEffector>,
    /// Default gains of a joint impedance loop.
    #[serde(default)]
    gains: Option<GainArrays>,
}

/// A place on the robot that works on the world.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffector {
    /// Link whose frame is controlled.
    pub frame: String,
    /// Joints that place it.
    pub joints: Vec<String>,
    /// Joints of its fingers, if it has any.
    #[serde(default)]
    pub fingers: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct GainArrays {
    kp: Vec<f64>,
    kd: Vec<f64>,
}

/// Gains of `tau = kp (q_des - q) + kd (v_des - v) + feed-forward`, one per independent joint in the order of `q`.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Stiffness \[Nm/rad or N/m\].
    pub kp: DVector<f64>,
    /// Damping \[Nms/rad or Ns/m\].
    pub kd: DVector<f64>,
}

/// A profile that does not fit the question or the model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// Not TOML, or not of this form.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// An array of the wrong length.
    #[error("{what} has {found} entries, expected {expected}: one per joint of `joints`")]
    Length {
        /// The array.
        what: String,
        /// Its length.
        found: usize,
        /// The number of joints.
        expected: usize,
    },
    /// No pose has this name.
    #[error("no pose is named \"{name}\"{}", suggestion(.nearest.as_deref()))]
    UnknownPose {
        /// The name asked for.
        name: String,
        /// The pose most likely meant.
        nearest: Option<String>,
    },
    /// No end effector has this name.
    #[error("no end effector is named \"{name}\"{}", suggestion(.nearest.as_deref()))]
    UnknownEndEffector {
        /// The name asked for.
        name: String,
        /// The end effector most likely meant.
        nearest: Option<String>,
    },
    /// The model has a joint the profile does not list.
    #[error("the profile does not list joint \"{joint}\" of robot \"{robot}\"")]
    MissingJoint {
        /// The joint.
        joint: String,
        /// The robot.
        robot: String,
    },
    /// The profile lists a joint the model does not have.
    #[error("{what} names joint \"{joint}\", which is no independent joint of robot \"{robot}\"")]
    UnknownJoint {
        /// Where it is named.
        what: String,
        /// The joint.
        joint: String,
        /// The robot.
        robot: String,
    },
    /// An end effector's frame is no link of the robot.
    #[error(transparent)]
    UnknownFrame(#[from] UnknownFrame),
    /// The profile has no gains.
    #[error("the profile gives no gains")]
    NoGains,
}

impl Profile {
    /// Parses the TOML text and checks that it is consistent in itself.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] on bad TOML, unknown keys, arrays of the wrong length, or a home pose that does not exist.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let profile: Self = toml::from_str(text)?;
        for (name, pose) in &profile.poses {
            profile.check_length(&format!("pose \"{name}\""), pose)?;
        }
        if let Some(gains) = &profile.gains {
            profile.check_length("gains.kp", &gains.kp)?;
            profile.check_length("gains.kd", &gains.kd)?;
        }
        profile.find_pose(&profile.home)?;
        Ok(profile)
    }

    /// Checks that every joint and frame named here belongs to `model`, and every joint of `model` is named.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] names the first that does not fit.
    pub fn check(&self, model: &Model) -> Result<(), ProfileError> {
        let known = |what: &str, joints: &[String]| {
            joints.iter().find(|joint| model.joint_index(joint).is_none()).map_or(Ok(()), |joint| {
                let (what, robot) = (what.to_owned(), model.name().to_owned());
                Err(ProfileError::UnknownJoint { what, joint: joint.clone(), robot })
            })
        };
        known("`joints`", &self.joints)?;
        self.home(model)?;
        for (name, end) in &self.end_effectors {
            model.frame(&end.frame)?;
            known(&format!("end effector \"{name}\""), &end.joints)?;
            known(&format!("end effector \"{name}\""), &end.fingers)?;
        }
        Ok(())
    }

    /// The home pose, in the order of the model's `q`.
    ///
    /// # Errors
    ///
    /// As [`pose`](Self::pose).
    pub fn home(&self, model: &Model) -> Result<DVector<f64>, ProfileError> {
        self.pose(model, &self.home)
    }

    /// The pose `name`, in the order of the model's `q`.
    ///
    /// # Errors
    ///
    /// [`ProfileError::UnknownPose`], or [`ProfileError::MissingJoint`] when the model has other joints.
    pub fn pose(&self, model: &Model, name: &str) -> Result<DVector<f64>, ProfileError> {
        self.arrange(model, self.find_pose(name)?)
    }

    /// The default gains, in the order of the model's `q`.
    ///
    /// # Errors
    ///
    /// [`ProfileError::NoGains`], or [`ProfileError::MissingJoint`] when the model has other joints.
    pub fn gains(&self, model: &Model) -> Result<Gains, ProfileError> {
        let gains = self.gains.as_ref().ok_or(ProfileError::NoGains)?;
        Ok(Gains { kp: self.arrange(model, &gains.kp)?, kd: self.arrange(model, &gains.kd)? })
    }

    /// The end effector `name`.
    ///
    /// # Errors
    ///
    /// [`ProfileError::UnknownEndEffector`], with the nearest name.
    pub fn end_effector(&self, name: &str) -> Result<&EndEffector, ProfileError> {
        self.end_effectors.get(name).ok_or_else(|| ProfileError::UnknownEndEffector {
            name: name.to_owned(),
            nearest: nearest(name, self.end_effectors.keys().map(String::as_str)).map(str::to_owned),
        })
    }

    fn find_pose(&self, name: &str) -> Result<&[f64], ProfileError> {
        self.poses.get(name).map(Vec::as_slice).ok_or_else(|| ProfileError::UnknownPose {
            name: name.to_owned(),
            nearest: nearest(name, self.poses.keys().map(String::as_str)).map(str::to_owned),
        })
    }

    fn arrange(&self, model: &Model, values: &[f64]) -> Result<DVector<f64>, ProfileError> {
        let mut arranged = DVector::zeros(model.joint_count());
        for (index, joint) in model.joint_names().iter().enumerate() {
            let Some(place) = self.joints.iter().position(|name| name == joint) else {
                let (joint, robot) = (joint.clone(), model.name().to_owned());
                return Err(ProfileError::MissingJoint { joint, robot });
            };
            arranged[index] = values[place];
        }
        Ok(arranged)
    }

    fn check_length(&self, what: &str, values: &[f64]) -> Result<(), ProfileError> {
        let (found, expected) = (values.len(), self.joints.len());
        if found == expected {
            return Ok(());
        }
        Err(ProfileError::Length { what: what.to_owned(), found, expected })
    }
}
