//! Errors in URDF files.

use std::fmt;
use std::path::PathBuf;

use crate::Position;
use crate::nearest::suggestion;

/// A URDF error with its position.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct UrdfError {
    /// The file, if the text came from one.
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
    /// The file uses an entity that it declares.
    #[error("entities are not supported; write the value of this one where it is used")]
    Entity,
    /// The file contains unexpanded xacro.
    #[error("this is a xacro file, not yet URDF; expand it first: xacro IN.urdf.xacro > OUT.urdf")]
    Xacro,
    /// The root element is not `<robot>`.
    #[error("the root element is <{0}>, expected <robot>")]
    Root(String),
    /// The robot has no links.
    #[error("the robot has no <link>")]
    Empty,
    /// An attribute is missing.
    #[error("<{element}> has no attribute \"{attribute}\"")]
    MissingAttribute {
        /// Element at fault.
        element: String,
        /// The missing part.
        attribute: &'static str,
    },
    /// A child element is missing.
    #[error("<{element}> has no <{child}>")]
    MissingElement {
        /// Element at fault.
        element: String,
        /// The missing part.
        child: &'static str,
    },
    /// A child element is duplicated.
    #[error("<{element}> has more than one <{child}>")]
    RepeatedElement {
        /// Element at fault.
        element: String,
        /// The repeated part.
        child: &'static str,
    },
    /// The attribute does not contain the expected numbers.
    #[error("{attribute}=\"{value}\" of <{element}>: expected {}", numbers(*.expected))]
    Number {
        /// Element at fault.
        element: String,
        /// Attribute at fault.
        attribute: &'static str,
        /// Its value.
        value: String,
        /// Expected number of values.
        expected: usize,
    },
    /// The orientation is given in an unsupported form.
    #[error(
        "quat_xyzw of <origin> is not supported; write the same rotation as rpy=\"ROLL PITCH YAW\" in radians"
    )]
    Quaternion,
    /// The joint type does not exist.
    #[error("joint \"{joint}\" has the unknown type \"{kind}\"{}", suggestion(.nearest.as_deref()))]
    UnknownJointType {
        /// Joint at fault.
        joint: String,
        /// Its type.
        kind: String,
        /// The type most likely meant.
        nearest: Option<String>,
    },
    /// The joint type is not supported.
    #[error(
        "joint \"{joint}\" is {kind}; only revolute, continuous, prismatic, planar and fixed joints are \
         supported, and one floating joint that carries the rest of the robot (model it as a chain of these, with massless links \
         between)"
    )]
    UnsupportedJointType {
        /// Joint at fault.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// Two links or two joints have the same name.
    #[error("a second {what} is named \"{name}\"; the first is at line {first}")]
    DuplicateName {
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
        /// Line of the first.
        first: u32,
    },
    /// The joint refers to an undefined link.
    #[error("the {role} link of joint \"{joint}\" is \"{link}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    UnknownLink {
        /// Joint at fault.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The unknown name.
        link: String,
        /// The link most likely meant.
        nearest: Option<String>,
    },
    /// The link is moved by two joints.
    #[error("link \"{link}\" is the child of two joints, \"{first}\" and \"{second}\"; a URDF is a tree")]
    TwoParents {
        /// Link at fault.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// More than one link has no parent joint.
    #[error("the robot has {} root links: {}; connect them with (fixed) joints", .0.len(), .0.join(", "))]
    SeveralRoots(Vec<String>),
    /// Links form a cycle.
    #[error("the links form a loop: {}; a URDF is a tree", .0.join(" -> "))]
    Loop(Vec<String>),
    /// The joint mimics an undefined joint.
    #[error("joint \"{joint}\" mimics \"{of}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    UnknownMimic {
        /// Joint at fault.
        joint: String,
        /// The unknown name.
        of: String,
        /// The joint most likely meant.
        nearest: Option<String>,
    },
    /// The joint mimics a joint that cannot move.
    #[error("joint \"{joint}\" mimics \"{of}\", which is fixed")]
    MimicOfFixed {
        /// Joint at fault.
        joint: String,
        /// The fixed joint.
        of: String,
    },
    /// The joint mimics a joint with several coordinates.
    #[error(
        "joint \"{joint}\" mimics \"{of}\", which is {kind} and has no single position; expected a revolute, continuous \
         or prismatic joint"
    )]
    MimicOfSeveral {
        /// Joint at fault.
        joint: String,
        /// The joint that it mimics.
        of: String,
        /// `floating` or `planar`.
        kind: &'static str,
    },
    /// Joints mimic each other in a loop.
    #[error("the joints mimic each other in a loop: {}", .0.join(" -> "))]
    MimicLoop(Vec<String>),
    /// The revolute or prismatic joint has no limits.
    #[error(
        "joint \"{0}\" has no <limit>; a revolute or prismatic joint needs one (an unlimited joint is \"continuous\")"
    )]
    MissingLimit(String),
    /// The range is empty.
    #[error("joint \"{joint}\" has its lower limit {lower} above its upper limit {upper}")]
    LowerAboveUpper {
        /// Joint at fault.
        joint: String,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A limit or coefficient is negative.
    #[error("joint \"{joint}\" has a negative {what}: {value}")]
    NegativeJointValue {
        /// Joint at fault.
        joint: String,
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// The axis has length zero.
    #[error("the axis of joint \"{0}\" is zero")]
    ZeroAxis(String),
    /// The mass is negative.
    #[error("link \"{link}\" has the negative mass {mass} kg")]
    NegativeMass {
        /// Link at fault.
        link: String,
        /// Its mass \[kg\].
        mass: f64,
    },
    /// Another problem, with its message.
    #[error("{0}")]
    Reader(String),
}

fn numbers(count: usize) -> String {
    match count {
        1 => "a number".to_owned(),
        _ => format!("{count} numbers separated by spaces"),
    }
}
