//! Checks that a profile is consistent, and that it matches its robot.

use super::{BaseKind, Profile, ProfileError, Steering};
use crate::{Model, PerJoint};

impl Profile {
    /// Checks lengths, the home pose, values that must be positive, and keys required by a drive.
    pub(super) fn check_itself(&self) -> Result<(), ProfileError> {
        for (name, pose) in &self.poses {
            self.check_length(&format!("pose \"{name}\""), pose.values())?;
        }
        if let Some(gains) = &self.gains {
            self.check_length("gains.kp", gains.kp.values())?;
            self.check_length("gains.kd", gains.kd.values())?;
        }
        for (key, limits) in [
            ("velocity", &self.limits.velocity),
            ("acceleration", &self.limits.acceleration),
            ("effort_rate", &self.limits.effort_rate),
        ] {
            let Some(limits) = limits.as_ref().map(PerJoint::values) else { continue };
            self.check_length(&format!("limits.{key}"), limits)?;
            for (joint, limit) in self.joints.iter().zip(limits) {
                if limit.is_nan() || *limit <= 0.0 {
                    let what = format!("the {key} limit of joint \"{joint}\"");
                    let (found, expected) = (limit.to_string(), "a positive number, or `inf` for no limit");
                    return Err(ProfileError::Value { what, found, expected });
                }
            }
        }
        self.find_pose(&self.home)?;
        if self.base == BaseKind::Fixed && !self.base_poses.is_empty() {
            return Err(ProfileError::FixedBasePlaced);
        }
        for name in self.base_poses.keys() {
            self.find_pose(name)?;
        }
        for (name, foot) in &self.feet {
            if foot.radius.is_some() && foot.sole.is_some() {
                return Err(ProfileError::TwoSoles(name.clone()));
            }
            let sides = foot.sole.iter().flatten().chain(&foot.radius);
            sides.copied().try_for_each(|side| positive(&format!("the size of foot \"{name}\""), side))?;
        }
        for (name, rotor) in &self.rotors {
            positive(&format!("max_thrust of rotor \"{name}\""), rotor.max_thrust)?;
            positive(&format!("torque_per_thrust of rotor \"{name}\""), rotor.torque_per_thrust)?;
        }
        for (name, foot) in &self.feet {
            if let Some(found) = foot.friction.filter(|friction| !(friction.is_finite() && *friction >= 0.0))
            {
                let (what, expected) = (format!("friction of foot \"{name}\""), "at least 0");
                return Err(ProfileError::Value { what, found: found.to_string(), expected });
            }
        }
        self.check_drive()
    }

    fn check_drive(&self) -> Result<(), ProfileError> {
        let Some(base) = &self.mobile_base else { return Ok(()) };
        let missing = |key| Err(ProfileError::MobileBase { drive: base.drive.name(), key });
        let on_wheels = base.drive != Steering::Omnidirectional;
        if on_wheels && base.wheels.is_empty() {
            return missing("wheels");
        }
        if !on_wheels && base.wheels.is_empty() && base.joints.is_empty() {
            return missing("joints");
        }
        if !base.wheels.is_empty() && base.wheel_radius.is_none() {
            return missing("wheel_radius");
        }
        if matches!(base.drive, Steering::Ackermann | Steering::SteeredWheels) && base.steering.is_empty() {
            return missing("steering");
        }
        if matches!(base.drive, Steering::Differential | Steering::Ackermann) && base.track.is_none() {
            return missing("track");
        }
        if base.drive == Steering::Ackermann && base.wheelbase.is_none() {
            return missing("wheelbase");
        }
        let sizes =
            [("wheel_radius", base.wheel_radius), ("track", base.track), ("wheelbase", base.wheelbase)];
        for (key, size) in sizes.into_iter().filter_map(|(key, size)| Some((key, size?))) {
            positive(&format!("mobile_base.{key}"), size)?;
        }
        Ok(())
    }

    fn check_length(&self, what: &str, values: &[f64]) -> Result<(), ProfileError> {
        let (found, expected) = (values.len(), self.joints.len());
        if found == expected {
            return Ok(());
        }
        Err(ProfileError::Length { what: what.to_owned(), found, expected })
    }

    /// Checks that every joint and frame that the profile names exists in `model`, and that the profile names
    /// every joint of `model`.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] for the first mismatch.
    pub fn check(&self, model: &Model) -> Result<(), ProfileError> {
        let known = |what: &str, joints: &[String]| {
            joints.iter().find(|joint| model.joint_index(joint).is_none()).map_or(Ok(()), |joint| {
                let (what, robot) = (what.to_owned(), model.name().to_owned());
                Err(ProfileError::UnknownJoint { what, joint: joint.clone(), robot })
            })
        };
        known("`joints`", &self.joints)?;
        self.home(model)?;
        known("`passive`", &self.passive)?;
        for (name, end) in &self.end_effectors {
            model.frame(&end.frame)?;
            known(&format!("end effector \"{name}\""), &end.joints)?;
            known(&format!("end effector \"{name}\""), &end.fingers)?;
        }
        for (name, foot) in &self.feet {
            model.frame(&foot.frame)?;
            known(&format!("foot \"{name}\""), &foot.joints)?;
        }
        if let Some(base) = &self.mobile_base {
            model.frame(&base.frame)?;
            for joints in [&base.joints, &base.wheels, &base.steering] {
                known("`mobile_base`", joints)?;
            }
        }
        for rotor in self.rotors.values() {
            model.frame(&rotor.frame)?;
        }
        Ok(())
    }
}

fn positive(what: &str, found: f64) -> Result<(), ProfileError> {
    if found.is_finite() && found > 0.0 {
        return Ok(());
    }
    let expected = "a positive number";
    Err(ProfileError::Value { what: what.to_owned(), found: found.to_string(), expected })
}
