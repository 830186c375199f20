//! Errors in profiles.

use crate::UnknownFrame;
use crate::nearest::suggestion_or_list;

/// The profile is invalid, or does not match the model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// The text is not TOML or not of the expected form.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// An array has the wrong length.
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
    #[error("no pose is named \"{name}\"{}", suggestion_or_list(.nearest.as_deref(), .known))]
    UnknownPose {
        /// The requested name.
        name: String,
        /// The pose most likely meant.
        nearest: Option<String>,
        /// The names of all poses.
        known: Vec<String>,
    },
    /// There is no end effector with this name.
    #[error("no end effector is named \"{name}\"{}", suggestion_or_list(.nearest.as_deref(), .known))]
    UnknownEndEffector {
        /// The requested name.
        name: String,
        /// The end effector most likely meant.
        nearest: Option<String>,
        /// The names of all end effectors.
        known: Vec<String>,
    },
    /// The model has a joint that the profile does not list.
    #[error("the profile does not list joint \"{joint}\" of robot \"{robot}\"")]
    MissingJoint {
        /// The joint.
        joint: String,
        /// The robot.
        robot: String,
    },
    /// The profile lists a joint that the model does not have.
    #[error("{what} names joint \"{joint}\", which is not an independent joint of robot \"{robot}\"")]
    UnknownJoint {
        /// The key that names the joint.
        what: String,
        /// The joint.
        joint: String,
        /// The robot.
        robot: String,
    },
    /// A frame named in the profile is not a link of the robot.
    #[error(transparent)]
    UnknownFrame(#[from] UnknownFrame),
    /// The profile has no gains.
    #[error("the profile has no gains")]
    NoGains,
    /// A value is invalid.
    #[error("{what} is {found}, expected {expected}")]
    Value {
        /// Name of the value.
        what: String,
        /// The value.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
    /// A foot is specified both as a ball and as flat.
    #[error("foot \"{0}\" has both a `radius` and a `sole`; a foot is a ball or flat")]
    TwoSoles(String),
    /// A mobile base lacks a required key.
    #[error("the mobile base is {drive}, which needs `{key}`")]
    MobileBase {
        /// Kind of steering.
        drive: &'static str,
        /// The missing key.
        key: &'static str,
    },
    /// Base poses are given for a fixed base.
    #[error(
        "`base_poses` is set, but the base is fixed to the world; write base = \"floating\", or remove `base_poses`"
    )]
    FixedBasePlaced,
}
