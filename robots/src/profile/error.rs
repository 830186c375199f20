//! Errors in profiles.

use crate::UnknownFrame;
use crate::nearest::suggestion_or_list;

/// Error of a profile that is invalid or does not match the model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// The text is not valid TOML, has an unknown key, or has a value of the wrong type.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// A list has the wrong length.
    #[error("{what} has {found} entries, expected {expected}: one per joint of `joints`")]
    Length {
        /// Description of the list.
        what: String,
        /// Length of the list.
        found: usize,
        /// Expected length: the number of joints.
        expected: usize,
    },
    /// No pose has this name.
    #[error("no pose is named \"{name}\"{}", suggestion_or_list(.nearest.as_deref(), .known))]
    UnknownPose {
        /// The requested name.
        name: String,
        /// The closest existing pose.
        nearest: Option<String>,
        /// Names of all poses.
        known: Vec<String>,
    },
    /// There is no end effector with this name.
    #[error("no end effector is named \"{name}\"{}", suggestion_or_list(.nearest.as_deref(), .known))]
    UnknownEndEffector {
        /// The requested name.
        name: String,
        /// The closest existing end effector.
        nearest: Option<String>,
        /// Names of all end effectors.
        known: Vec<String>,
    },
    /// The model has a joint that the profile does not list.
    #[error("the profile does not list joint \"{joint}\" of robot \"{robot}\"")]
    MissingJoint {
        /// Name of the joint.
        joint: String,
        /// Name of the robot.
        robot: String,
    },
    /// The profile lists a joint that the model does not have.
    #[error("{what} names joint \"{joint}\", which is not an independent joint of robot \"{robot}\"")]
    UnknownJoint {
        /// Key that names the joint.
        what: String,
        /// Name of the joint.
        joint: String,
        /// Name of the robot.
        robot: String,
    },
    /// The profile names a frame that is not a link of the robot.
    #[error(transparent)]
    UnknownFrame(#[from] UnknownFrame),
    /// The profile has no gains, but gains are needed.
    #[error("the profile has no gains")]
    NoGains,
    /// A value is out of range.
    #[error("{what} is {found}, expected {expected}")]
    Value {
        /// Description of the value.
        what: String,
        /// Actual value.
        found: String,
        /// Expected value, as a phrase.
        expected: &'static str,
    },
    /// A foot is specified both as a ball and as flat.
    #[error("foot \"{0}\" has both a `radius` and a `sole`; remove one of them")]
    TwoSoles(String),
    /// A mobile base lacks a required key.
    #[error("the mobile base is {drive}, which requires `{key}`")]
    MobileBase {
        /// Type of steering.
        drive: &'static str,
        /// Name of the missing key.
        key: &'static str,
    },
    /// The profile has poses of the base, but the base is fixed.
    #[error(
        "`base_poses` is set, but the base is fixed to the world; write base = \"floating\", or remove `base_poses`"
    )]
    FixedBasePlaced,
}
