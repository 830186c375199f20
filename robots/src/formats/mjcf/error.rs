//! Errors of MJCF files.

use std::fmt;
use std::path::PathBuf;

use crate::Position;
use crate::nearest::suggestion;

/// An error in an MJCF file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct MjcfError {
    /// Path of the file; `None` if the text is not from a file.
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
    /// The root element is not `<mujoco>`, but an element with this name.
    #[error("the root element is <{0}>, expected <mujoco>")]
    Root(String),
    /// The element with this name is not supported.
    #[error(
        "<{0}> is not supported; resave the file with MuJoCo (mj_saveLastXML) \
         or use a URDF of the robot"
    )]
    Element(String),
    /// The value of an attribute is not supported.
    #[error("{attribute}=\"{value}\" of <{element}> is not supported{}", because(.reason))]
    Attribute {
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// Value of the attribute.
        value: String,
        /// Reason or alternative; may be empty.
        reason: &'static str,
    },
    /// An attribute is missing.
    #[error("<{element}> has no attribute \"{attribute}\"")]
    Missing {
        /// Name of the element.
        element: String,
        /// Name of the missing attribute.
        attribute: &'static str,
    },
    /// The numbers of an attribute are malformed.
    #[error("{attribute}=\"{value}\" of <{element}>: expected {expected}")]
    Number {
        /// Name of the element.
        element: String,
        /// Name of the attribute.
        attribute: String,
        /// Value of the attribute.
        value: String,
        /// Expected numbers, as a phrase.
        expected: String,
    },
    /// The element refers to a name that does not exist.
    #[error("<{element}> names the {what} \"{name}\", which does not exist{}", suggestion(.nearest.as_deref()))]
    Unknown {
        /// Name of the element.
        element: String,
        /// Type of the referenced element: `joint`, `body`, `mesh` or `class`.
        what: &'static str,
        /// The unknown name.
        name: String,
        /// The closest existing name.
        nearest: Option<String>,
    },
    /// Two elements have the same name.
    #[error("a second {what} is named \"{name}\"")]
    Duplicate {
        /// Type of the elements: `body`, `site`, `joint` or `class`.
        what: &'static str,
        /// The duplicate name.
        name: String,
    },
    /// A problem that has no separate variant, with its message.
    #[error("{0}")]
    Other(String),
}

fn because(reason: &str) -> String {
    if reason.is_empty() { String::new() } else { format!(": {reason}") }
}
