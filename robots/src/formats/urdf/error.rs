//! Errors in URDF files.

use std::fmt;
use std::path::PathBuf;

use crate::Position;
use crate::nearest::suggestion;

/// An error in a URDF file, with its position.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct UrdfError {
    /// Path of the file; `None` if the text is not from a file.
    pub file: Option<PathBuf>,
    /// Position of the faulty element; `None` if the error concerns the whole file.
    pub at: Option<Position>,
    /// The problem.
    pub problem: Box<UrdfProblem>,
}

impl fmt::Display for UrdfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}", file.display())?,
            None => f.write_str("URDF")?,
        }
        if let Some(Position { line, column }) = self.at {
            write!(f, ":{line}:{column}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl UrdfError {
    pub(crate) fn new(at: impl Into<Option<Position>>, problem: UrdfProblem) -> Self {
        Self { file: None, at: at.into(), problem: Box::new(problem) }
    }
}

/// A problem in a URDF file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfProblem {
    /// The XML is not well-formed.
    #[error("not well-formed XML: {0}")]
    Xml(String),
    /// The file declares and uses an XML entity, which is not supported.
    #[error("XML entities are not supported; write the value of the entity where it is used")]
    Entity,
    /// The file is an unexpanded xacro file.
    #[error("this is a xacro file, not yet URDF; expand it first: xacro IN.urdf.xacro > OUT.urdf")]
    Xacro,
    /// The root element is not `<robot>`, but an element with this name.
    #[error("the root element is <{0}>, expected <robot>")]
    Root(String),
    /// The robot has no links.
    #[error("the robot has no <link>")]
    Empty,
    /// An attribute is missing.
    #[error("<{element}> has no attribute \"{attribute}\"")]
    MissingAttribute {
        /// Name of the element.
        element: String,
        /// Name of the missing attribute.
        attribute: &'static str,
    },
    /// A child element is missing.
    #[error("<{element}> has no <{child}>")]
    MissingElement {
        /// Name of the element.
        element: String,
        /// Name of the missing child element.
        child: &'static str,
    },
    /// A child element is duplicated.
    #[error("<{element}> has more than one <{child}>")]
    RepeatedElement {
        /// Name of the element.
        element: String,
        /// Name of the repeated child element.
        child: &'static str,
    },
    /// The value of an attribute is not a list of numbers of the expected length.
    #[error("{attribute}=\"{value}\" of <{element}>: expected {}", numbers(*.expected))]
    Number {
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: &'static str,
        /// Value of the attribute.
        value: String,
        /// Expected length of the list.
        expected: usize,
    },
    /// The orientation is a quaternion, which is not supported.
    #[error(
        "quat_xyzw of <origin> is not supported; write the same rotation as rpy=\"ROLL PITCH YAW\" in radians"
    )]
    Quaternion,
    /// The joint type does not exist.
    #[error("joint \"{joint}\" has the unknown type \"{kind}\"{}", suggestion(.nearest.as_deref()))]
    UnknownJointType {
        /// Name of the joint.
        joint: String,
        /// Unknown type of the joint.
        kind: String,
        /// The closest known type.
        nearest: Option<String>,
    },
    /// The joint type is not supported.
    #[error(
        "joint \"{joint}\" is {kind}; only revolute, continuous, prismatic, planar and fixed joints are supported, \
         and one floating joint that carries the rest of the robot (model the joint as a chain of these, with \
         massless links in between)"
    )]
    UnsupportedJointType {
        /// Name of the joint.
        joint: String,
        /// Type of the joint.
        kind: String,
    },
    /// Two links or two joints have the same name.
    #[error("a second {what} is named \"{name}\"; the first is at line {first}")]
    DuplicateName {
        /// Type of the duplicates: `link` or `joint`.
        what: &'static str,
        /// The duplicate name.
        name: String,
        /// Line of the first occurrence.
        first: u32,
    },
    /// A joint refers to a link that the file does not define.
    #[error("the {role} link of joint \"{joint}\" is \"{link}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    UnknownLink {
        /// Name of the joint.
        joint: String,
        /// Role of the link: `parent` or `child`.
        role: &'static str,
        /// The unknown name.
        link: String,
        /// The closest existing link.
        nearest: Option<String>,
    },
    /// A link is the child of two joints.
    #[error(
        "link \"{link}\" is the child of two joints, \"{first}\" and \"{second}\"; a URDF must be a tree"
    )]
    TwoParents {
        /// Name of the link.
        link: String,
        /// Name of the first joint.
        first: String,
        /// Name of the second joint.
        second: String,
    },
    /// Several links, with these names, have no parent joint.
    #[error("the robot has {} root links: {}; connect them with (fixed) joints", .0.len(), .0.join(", "))]
    SeveralRoots(Vec<String>),
    /// The links with these names, in this order, form a loop.
    #[error("the links form a loop: {}; a URDF must be a tree", .0.join(" -> "))]
    Loop(Vec<String>),
    /// A joint mimics a joint that the file does not define.
    #[error("joint \"{joint}\" mimics \"{of}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    UnknownMimic {
        /// Name of the joint.
        joint: String,
        /// Name of the unknown joint.
        of: String,
        /// The closest existing joint.
        nearest: Option<String>,
    },
    /// A joint mimics a fixed joint, which has no position.
    #[error("joint \"{joint}\" mimics \"{of}\", which is fixed")]
    MimicOfFixed {
        /// Name of the joint.
        joint: String,
        /// Name of the fixed joint.
        of: String,
    },
    /// A joint mimics a joint with several coordinates, which is not supported.
    #[error(
        "joint \"{joint}\" mimics \"{of}\", which is {kind} and has no single position; expected a revolute, continuous \
         or prismatic joint"
    )]
    MimicOfSeveral {
        /// Name of the joint.
        joint: String,
        /// Name of the mimicked joint.
        of: String,
        /// Type of the mimicked joint: `floating` or `planar`.
        kind: &'static str,
    },
    /// The joints with these names, in this order, mimic each other in a loop.
    #[error("the joints mimic each other in a loop: {}", .0.join(" -> "))]
    MimicLoop(Vec<String>),
    /// The revolute or prismatic joint with this name has no limits.
    #[error(
        "joint \"{0}\" has no <limit>; a revolute or prismatic joint needs one (an unlimited joint is \"continuous\")"
    )]
    MissingLimit(String),
    /// The range of a joint is empty.
    #[error("joint \"{joint}\" has its lower limit {lower} above its upper limit {upper}")]
    LowerAboveUpper {
        /// Name of the joint.
        joint: String,
        /// Lower limit of the joint.
        lower: f64,
        /// Upper limit of the joint.
        upper: f64,
    },
    /// A limit or coefficient of a joint is negative.
    #[error("joint \"{joint}\" has a negative {what}: {value}")]
    NegativeJointValue {
        /// Name of the joint.
        joint: String,
        /// Description of the value.
        what: &'static str,
        /// The negative value.
        value: f64,
    },
    /// The axis of the joint with this name has zero length.
    #[error("the axis of joint \"{0}\" is zero")]
    ZeroAxis(String),
    /// The mass of a link is negative.
    #[error("link \"{link}\" has the negative mass {mass} kg")]
    NegativeMass {
        /// Name of the link.
        link: String,
        /// Mass of the link \[kg\].
        mass: f64,
    },
    /// A problem that has no separate variant, with its message.
    #[error("{0}")]
    Reader(String),
}

fn numbers(count: usize) -> String {
    match count {
        1 => "a number".to_owned(),
        _ => format!("{count} numbers separated by spaces"),
    }
}
