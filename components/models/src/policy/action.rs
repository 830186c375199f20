//! Definition of a policy's outputs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::numbers::{finite, one, zero};
use super::{JointTarget, JointTargets, Numbers, PolicyError, TwistRanges, is_ordered};

/// Quantity that an action commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ActionKind {
    /// Joint positions \[rad or m\].
    #[default]
    Position,
    /// Joint velocities \[rad/s or m/s\].
    Velocity,
    /// Joint efforts \[Nm or N\].
    Effort,
    /// Velocity of a wheeled base, within the ranges of `twist`.
    BaseTwist,
}

/// Mapping of a network's outputs to commands.
///
/// The target of a joint is `default_pose + offset + scale clamp(output, clip)`; the default pose applies to
/// positions only. An action of the kind `base_twist` has the ranges `twist` instead of joints, and its
/// outputs are from -1 to 1.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Action {
    /// Joint of each output. Required, except for a base twist, which has no joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<String>,
    /// Quantity that the action commands. Default: position.
    #[serde(default)]
    pub kind: ActionKind,
    /// Factor of the network's outputs: one number for all joints, or one per joint. Default: 1.
    #[serde(default = "one")]
    pub scale: Numbers,
    /// Offset that is added to the scaled output, in addition to the default pose. Default: 0.
    #[serde(default = "zero")]
    pub offset: Numbers,
    /// Joint positions that an action of 0 commands \[rad or m\], in the order of `joints`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub default_pose: Vec<f64>,
    /// Minimum and maximum of the network's outputs before the factor. Default: unbounded.
    #[serde(default)]
    pub clip: Option<[f64; 2]>,
    /// Stiffness of the drives \[Nm/rad or N/m\]. Default: the gains of the robot's profile.
    #[serde(default)]
    pub kp: Option<Numbers>,
    /// Damping of the drives \[Nms/rad or Ns/m\]. Default: the gains of the robot's profile.
    #[serde(default)]
    pub kd: Option<Numbers>,
    /// Ranges of a base twist; only for `kind = "base_twist"`.
    #[serde(default)]
    pub twist: Option<TwistRanges>,
}

impl Action {
    /// Returns the number of the network's outputs: one per joint, or one per range of a base twist.
    pub fn outputs(&self) -> usize {
        self.joints.len() + self.twist.map_or(0, |twist| twist.outputs())
    }

    /// Returns the bounds of the network's outputs: from -1 to 1 for a base twist, otherwise `clip`.
    pub fn bounds(&self) -> Option<[f64; 2]> {
        if self.twist.is_some() { Some(TwistRanges::BOUNDS) } else { self.clip }
    }

    /// Checks counts and ranges. Errors report keys that start with `prefix`.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Value`] with the key of the first invalid value.
    pub fn check(&self, prefix: &str) -> Result<(), PolicyError> {
        let wrong =
            |key: &str, message: String| Err(PolicyError::Value { key: format!("{prefix}{key}"), message });
        let Self { joints, scale, offset, default_pose, clip, kp, kd, .. } = self;
        let count = joints.len();
        match (self.kind, &self.twist) {
            (ActionKind::BaseTwist, Some(twist)) => {
                twist.check(&format!("{prefix}twist"))?;
                for (key, is_given) in [
                    ("joints", count > 0),
                    ("scale", *scale != one()),
                    ("offset", *offset != zero()),
                    ("default_pose", !default_pose.is_empty()),
                    ("clip", clip.is_some()),
                    ("kp", kp.is_some()),
                    ("kd", kd.is_some()),
                ] {
                    if is_given {
                        let message = "found a value, expected no value, because `twist` has the ranges of a base twist";
                        return wrong(key, message.to_owned());
                    }
                }
                return Ok(());
            }
            (ActionKind::BaseTwist, None) => {
                return wrong("twist", "missing, expected the ranges of a base twist".to_owned());
            }
            (_, Some(_)) => return wrong("twist", "expected only for `kind = \"base_twist\"`".to_owned()),
            (_, None) => {}
        }
        if count == 0 {
            return wrong("joints", "found no joint, expected at least one".to_owned());
        }
        if let Some(name) = joints.iter().enumerate().find(|(k, name)| joints[..*k].contains(name)) {
            return wrong("joints", format!("found \"{}\" twice, expected each joint once", name.1));
        }
        if default_pose.len() != count {
            let message =
                format!("found {} numbers, expected {count}, one for each joint", default_pose.len());
            return wrong("default_pose", message);
        }
        finite(&format!("{prefix}default_pose"), default_pose.iter().copied())?;
        for (key, numbers) in
            [("scale", Some(scale)), ("offset", Some(offset)), ("kp", kp.as_ref()), ("kd", kd.as_ref())]
        {
            numbers.map_or(Ok(()), |numbers| numbers.check(&format!("{prefix}{key}"), count))?;
        }
        for (key, numbers) in [("kp", kp), ("kd", kd)] {
            let is_negative = |numbers: &Numbers| (0..count).any(|index| numbers.get(index) < 0.0);
            if numbers.as_ref().is_some_and(is_negative) {
                return wrong(key, "found a negative gain, expected at least 0".to_owned());
            }
        }
        if !is_ordered(clip) {
            return wrong("clip", format!("found {clip:?}, expected a lower and a higher bound"));
        }
        Ok(())
    }

    /// Creates the mapping from actions to joint targets of a robot with the joints `robot`. Joints that the
    /// policy does not command are unaffected; a base twist commands no joints.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Joints`] if the robot lacks a joint of the policy.
    pub fn joint_targets(&self, robot: &[impl AsRef<str>]) -> Result<JointTargets, PolicyError> {
        let (mut targets, mut missing) = (Vec::new(), Vec::new());
        for (index, name) in self.joints.iter().enumerate() {
            let Some(joint) = robot.iter().position(|joint| joint.as_ref() == name) else {
                missing.push(format!("\"{name}\""));
                continue;
            };
            let shift = if self.kind == ActionKind::Position { self.default_pose[index] } else { 0.0 };
            let offset = shift + self.offset.get(index);
            targets.push(JointTarget { joint, scale: self.scale.get(index), offset });
        }
        if missing.is_empty() {
            let clip = self.bounds().unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            return Ok(JointTargets::new(targets, clip));
        }
        let names: Vec<&str> = robot.iter().map(AsRef::as_ref).collect();
        let message =
            format!("the robot has no joint {}; its joints are {}", missing.join(", "), names.join(", "));
        Err(PolicyError::Joints { message })
    }
}
