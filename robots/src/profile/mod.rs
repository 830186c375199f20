//! Robot profiles: TOML files with the data that a URDF lacks, such as poses, end effectors, feet and gains.

mod check;
mod error;
mod parts;

use std::collections::BTreeMap;

use nalgebra::DVector;
use serde::Deserialize;

pub use error::ProfileError;
pub use parts::{BaseKind, BasePose, EndEffector, Foot, MobileBase, Rotor, Spin, Steering};

use crate::model::configuration::write_pose;
use crate::nearest::nearest;
use crate::{Model, PerJoint};

/// Poses, end effectors, feet and gains of one robot. Lists are in the order of `joints`; a single number
/// applies to all joints.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Display name of the robot.
    pub title: String,
    /// Sources of the values, such as data sheets.
    pub sources: Vec<String>,
    /// Kind of the robot's base, unless the load options override it. Default: as in the URDF.
    #[serde(default)]
    pub base: BaseKind,
    /// Names of the independent joints, in the order of every list below.
    pub joints: Vec<String>,
    /// Name of the home pose in `poses`.
    pub home: String,
    /// Names of the joints without a drive.
    #[serde(default)]
    pub passive: Vec<String>,
    /// Named poses of the joints \[rad or m\].
    pub poses: BTreeMap<String, PerJoint>,
    /// Poses of a floating base in the world, by the name of the corresponding entry of `poses`.
    #[serde(default)]
    pub base_poses: BTreeMap<String, BasePose>,
    /// Named end effectors.
    #[serde(default)]
    pub end_effectors: BTreeMap<String, EndEffector>,
    /// Feet, by name. Driven wheels are in `mobile_base`.
    #[serde(default)]
    pub feet: BTreeMap<String, Foot>,
    /// Wheels and steering of a mobile base.
    pub mobile_base: Option<MobileBase>,
    /// Named rotors.
    #[serde(default)]
    pub rotors: BTreeMap<String, Rotor>,
    /// Default gains of a joint impedance loop.
    #[serde(default)]
    pub(crate) gains: Option<GainArrays>,
    /// Limits not contained in a URDF.
    #[serde(default)]
    limits: LimitArrays,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitArrays {
    /// Velocity limit of each joint \[rad/s or m/s\], below the file's; `inf` keeps the file's limit.
    velocity: Option<PerJoint>,
    /// Maximum acceleration of each joint \[rad/s2 or m/s2\]; `inf` for no limit.
    acceleration: Option<PerJoint>,
    /// Maximum rate of change of each drive's effort \[Nm/s or N/s\]; `inf` for no limit.
    effort_rate: Option<PerJoint>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GainArrays {
    pub(crate) kp: PerJoint,
    pub(crate) kd: PerJoint,
}

/// Default gains of `tau = kp (q_des - q) + kd (v_des - v) + feed-forward`, one per independent joint in the
/// order of `q`.
///
/// Both gains are zero for a passive joint. `kp` is zero for a velocity-controlled joint, such as a wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Stiffness \[Nm/rad or N/m\].
    pub kp: DVector<f64>,
    /// Damping \[Nms/rad or Ns/m\].
    pub kd: DVector<f64>,
}

impl Profile {
    /// Creates an empty profile.
    pub(crate) fn empty() -> Self {
        Self {
            title: String::new(),
            sources: Vec::new(),
            base: BaseKind::default(),
            joints: Vec::new(),
            home: String::new(),
            passive: Vec::new(),
            poses: BTreeMap::new(),
            base_poses: BTreeMap::new(),
            end_effectors: BTreeMap::new(),
            feet: BTreeMap::new(),
            mobile_base: None,
            rotors: BTreeMap::new(),
            gains: None,
            limits: LimitArrays::default(),
        }
    }

    /// Parses a profile from TOML text and checks its consistency.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] for invalid TOML, unknown keys, lists of the wrong length, an unknown home pose, or
    /// values out of range.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let mut profile: Self = toml::from_str(text)?;
        profile.spread();
        profile.check_itself()?;
        Ok(profile)
    }

    /// Expands single numbers to lists.
    fn spread(&mut self) {
        let joints = self.joints.len();
        let LimitArrays { velocity, acceleration, effort_rate } = &mut self.limits;
        let limits = [velocity, acceleration, effort_rate].into_iter().flatten();
        let gains = self.gains.iter_mut().flat_map(|GainArrays { kp, kd }| [kp, kd]);
        for numbers in self.poses.values_mut().chain(limits).chain(gains) {
            if let PerJoint::All(number) = *numbers {
                *numbers = PerJoint::Each(vec![number; joints]);
            }
        }
    }

    /// Calls `change` for each list with one number per joint.
    pub(crate) fn arrays(&mut self, change: &mut dyn FnMut(&mut Vec<f64>)) {
        self.spread();
        let LimitArrays { velocity, acceleration, effort_rate } = &mut self.limits;
        let limits = [velocity, acceleration, effort_rate].into_iter().flatten();
        let gains = self.gains.iter_mut().flat_map(|GainArrays { kp, kd }| [kp, kd]);
        for numbers in self.poses.values_mut().chain(limits).chain(gains) {
            if let PerJoint::Each(values) = numbers {
                change(values);
            }
        }
    }

    /// Returns the joint positions of the home pose \[rad or m\], in the order of the model's joints.
    ///
    /// # Errors
    ///
    /// See [`pose`](Self::pose).
    pub fn home(&self, model: &Model) -> Result<DVector<f64>, ProfileError> {
        self.pose(model, &self.home)
    }

    /// Returns the joint positions of the pose `name` \[rad or m\], in the order of the model's joints. For a
    /// fixed base, this is all of `q`.
    ///
    /// # Errors
    ///
    /// [`ProfileError::UnknownPose`], or [`ProfileError::MissingJoint`] if the model has a joint that the
    /// profile does not list.
    pub fn pose(&self, model: &Model, name: &str) -> Result<DVector<f64>, ProfileError> {
        self.arrange(model, self.find_pose(name)?)
    }

    /// Returns the configuration `q` (nq) of the pose `name`. A floating base is at its pose in `base_poses`
    /// or, if there is none for `name`, at its pose in the neutral configuration.
    ///
    /// # Errors
    ///
    /// See [`pose`](Self::pose).
    pub fn configuration(&self, model: &Model, name: &str) -> Result<DVector<f64>, ProfileError> {
        let joints = self.pose(model, name)?;
        let mut q = DVector::from_vec(model.neutral());
        let offset = q.len() - joints.len();
        q.rows_mut(offset, joints.len()).copy_from(&joints);
        if let (Some(base), true) = (self.base_poses.get(name), model.base().floating) {
            write_pose(&base.isometry(), q.as_mut_slice());
        }
        Ok(q)
    }

    /// Returns the default gains, in the order of the model's joints.
    ///
    /// # Errors
    ///
    /// [`ProfileError::NoGains`], or [`ProfileError::MissingJoint`] if the model has a joint that the profile
    /// does not list.
    pub fn gains(&self, model: &Model) -> Result<Gains, ProfileError> {
        let gains = self.gains.as_ref().ok_or(ProfileError::NoGains)?;
        Ok(Gains { kp: self.arrange(model, gains.kp.values())?, kd: self.arrange(model, gains.kd.values())? })
    }

    /// Returns the acceleration limits \[rad/s2 or m/s2\], in the order of the model's joints; infinite
    /// without a limit.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?;
    /// let limits = panda.profile.ok_or("no profile")?.acceleration_limit(&panda.model)?;
    /// assert_eq!(limits[1], 7.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`ProfileError::MissingJoint`] if the model has a joint that the profile does not list.
    pub fn acceleration_limit(&self, model: &Model) -> Result<DVector<f64>, ProfileError> {
        self.arrange_limits(model, &self.limits.acceleration)
    }

    /// Returns the velocity limits \[rad/s or m/s\], in the order of the model's joints; infinite without a
    /// limit. When a robot is loaded with its profile, the smaller limit applies: the limit in the profile or
    /// the limit in the robot's file.
    ///
    /// # Errors
    ///
    /// [`ProfileError::MissingJoint`] if the model has a joint that the profile does not list.
    pub fn velocity_limit(&self, model: &Model) -> Result<DVector<f64>, ProfileError> {
        self.arrange_limits(model, &self.limits.velocity)
    }

    /// Returns the limits of the rate of change of the drives' efforts \[Nm/s or N/s\], in the order of the
    /// model's joints; infinite without a limit.
    ///
    /// # Errors
    ///
    /// [`ProfileError::MissingJoint`] if the model has a joint that the profile does not list.
    pub fn effort_rate_limit(&self, model: &Model) -> Result<DVector<f64>, ProfileError> {
        self.arrange_limits(model, &self.limits.effort_rate)
    }

    fn arrange_limits(&self, model: &Model, limits: &Option<PerJoint>) -> Result<DVector<f64>, ProfileError> {
        match limits {
            Some(limits) => self.arrange(model, limits.values()),
            None => Ok(DVector::from_element(model.joint_count(), f64::INFINITY)),
        }
    }

    /// Returns the end effector with this name.
    ///
    /// # Errors
    ///
    /// [`ProfileError::UnknownEndEffector`] with the closest existing name.
    pub fn end_effector(&self, name: &str) -> Result<&EndEffector, ProfileError> {
        self.end_effectors.get(name).ok_or_else(|| ProfileError::UnknownEndEffector {
            name: name.to_owned(),
            nearest: nearest(name, self.end_effectors.keys().map(String::as_str)).map(str::to_owned),
            known: self.end_effectors.keys().cloned().collect(),
        })
    }

    fn find_pose(&self, name: &str) -> Result<&[f64], ProfileError> {
        self.poses.get(name).map(PerJoint::values).ok_or_else(|| ProfileError::UnknownPose {
            name: name.to_owned(),
            nearest: nearest(name, self.poses.keys().map(String::as_str)).map(str::to_owned),
            known: self.poses.keys().cloned().collect(),
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
}
