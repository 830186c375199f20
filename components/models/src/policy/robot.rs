//! Comparison of a robot with the robot for which a policy was trained.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Digests that identify a robot, computed from the robot's model and profile.
///
/// ```
/// use motorium_models::policy::{RobotDifference, RobotDigest};
///
/// let trained = RobotDigest { joints: 7, dynamics: 38 };
/// assert_eq!(trained.difference(&trained), None);
/// let tuned = RobotDigest { dynamics: 39, ..trained };
/// assert_eq!(trained.difference(&tuned), Some(RobotDifference::Dynamics));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDigest {
    /// Digest of the policy's joints: names, kinds, axes and limits. Written as 16 hexadecimal digits.
    #[serde(serialize_with = "write", deserialize_with = "read")]
    pub joints: u64,
    /// Digest of the properties of the robot that `joints` does not cover: links, masses, drives and gains.
    /// Written as 16 hexadecimal digits.
    #[serde(serialize_with = "write", deserialize_with = "read")]
    pub dynamics: u64,
}

/// Difference between the robot of a policy and another robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobotDifference {
    /// The commanded joints or their limits differ. The same actions may move different joints, or move
    /// joints farther.
    Joints,
    /// Properties other than the commanded joints differ, such as masses or gains. The policy may move the
    /// robot differently.
    Dynamics,
}

impl RobotDigest {
    /// Returns the difference from the robot with the digest `other`; `None` if both digests are equal.
    pub fn difference(&self, robot: &Self) -> Option<RobotDifference> {
        if self.joints != robot.joints {
            return Some(RobotDifference::Joints);
        }
        (self.dynamics != robot.dynamics).then_some(RobotDifference::Dynamics)
    }
}

fn write<S: Serializer>(digest: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{digest:016x}"))
}

fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let text = String::deserialize(deserializer)?;
    let digits = text.len() == 16 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let number = u64::from_str_radix(&text, 16).ok().filter(|_| digits);
    number.ok_or_else(|| {
        serde::de::Error::custom(format!("found \"{text}\", expected a digest of 16 hexadecimal digits"))
    })
}
