//! Errors of MJCF files.

use std::fmt;
use std::path::PathBuf;

use crate::Position;
use crate::nearest::suggestion;

/// An MJCF file that cannot become a model, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct MjcfError {
    /// The file, when the text came from one.
    pub file: Option<PathBuf>,
    /// The element at fault.
    pub at: Position,
    /// What is wrong.
    pub problem: Box<MjcfProblem>,
}

impl fmt::Display for MjcfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}", file.display())?,
            None => f.write_str("MJCF")?,
        }
        write!(f, ":{}:{}: {}", self.at.line, self.at.column, self.problem)
    }
}

/// What is wrong with an MJCF file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MjcfProblem {
    /// Not well-formed XML.
    #[error("not well-formed XML: {0}")]
    Xml(String),
    /// Another root element.
    #[error("the root element is <{0}>, expected <mujoco>")]
    Root(String),
    /// An element that is not among those read.
    #[error(
        "<{0}> is not among the MJCF read here; let MuJoCo write the file out (mj_saveLastXML) \
         or use a URDF of the robot"
    )]
    Element(String),
    /// An attribute that is not among those read.
    #[error("{attribute}=\"{value}\" of <{element}> is not among the MJCF read here{}", because(.reason))]
    Attribute {
        /// Element at fault.
        element: String,
        /// Attribute at fault.
        attribute: String,
        /// Its value.
        value: String,
        /// What to do instead.
        reason: &'static str,
    },
    /// A missing attribute.
    #[error("<{element}> has no attribute \"{attribute}\"")]
    Missing {
        /// Element at fault.
        element: String,
        /// What it lacks.
        attribute: &'static str,
    },
    /// An attribute that is not the numbers it should be.
    #[error("{attribute}=\"{value}\" of <{element}>: expected {expected}")]
    Number {
        /// Element at fault.
        element: String,
        /// Attribute at fault.
        attribute: String,
        /// Its value.
        value: String,
        /// What it should hold.
        expected: String,
    },
    /// A name that nothing has.
    #[error("<{element}> names the {what} \"{name}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    Unknown {
        /// Element at fault.
        element: String,
        /// What it names.
        what: &'static str,
        /// The name.
        name: String,
        /// The one most likely meant.
        nearest: Option<String>,
    },
    /// Two bodies or joints of the same name.
    #[error("a second {what} is named \"{name}\"")]
    Duplicate {
        /// `body` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

fn because(reason: &str) -> String {
    if reason.is_empty() { String::new() } else { format!(": {reason}") }
}
