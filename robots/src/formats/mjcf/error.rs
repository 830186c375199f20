//! Errors of MJCF files.

use std::fmt;
use std::path::PathBuf;

use crate::Position;
use crate::nearest::suggestion;

/// An error in an MJCF file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct MjcfError {
    /// The file, if the text came from one.
    pub file: Option<PathBuf>,
    /// Position of the faulty element.
    pub at: Position,
    /// The problem.
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

/// A problem in an MJCF file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MjcfProblem {
    /// The XML is not well-formed.
    #[error("not well-formed XML: {0}")]
    Xml(String),
    /// The root element is not `<mujoco>`.
    #[error("the root element is <{0}>, expected <mujoco>")]
    Root(String),
    /// The element is not supported.
    #[error(
        "<{0}> is not supported; resave the file with MuJoCo (mj_saveLastXML) \
         or use a URDF of the robot"
    )]
    Element(String),
    /// The attribute is not supported.
    #[error("{attribute}=\"{value}\" of <{element}> is not supported{}", because(.reason))]
    Attribute {
        /// Element at fault.
        element: String,
        /// Attribute at fault.
        attribute: String,
        /// Its value.
        value: String,
        /// The reason, or the alternative; may be empty.
        reason: &'static str,
    },
    /// An attribute is missing.
    #[error("<{element}> has no attribute \"{attribute}\"")]
    Missing {
        /// Element at fault.
        element: String,
        /// The missing attribute.
        attribute: &'static str,
    },
    /// The numbers of an attribute are malformed.
    #[error("{attribute}=\"{value}\" of <{element}>: expected {expected}")]
    Number {
        /// Element at fault.
        element: String,
        /// Attribute at fault.
        attribute: String,
        /// Its value.
        value: String,
        /// The expected numbers.
        expected: String,
    },
    /// The referenced name does not exist.
    #[error("<{element}> names the {what} \"{name}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    Unknown {
        /// Element at fault.
        element: String,
        /// The kind of element: `joint`, `body`, `mesh` or `class`.
        what: &'static str,
        /// The name.
        name: String,
        /// The most similar name that exists.
        nearest: Option<String>,
    },
    /// Two elements have the same name.
    #[error("a second {what} is named \"{name}\"")]
    Duplicate {
        /// The kind of element: `body`, `site`, `joint` or `class`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Another problem, with its message.
    #[error("{0}")]
    Other(String),
}

fn because(reason: &str) -> String {
    if reason.is_empty() { String::new() } else { format!(": {reason}") }
}
