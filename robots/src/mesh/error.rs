//! Errors of mesh files.

use std::fmt;
use std::path::PathBuf;

/// A problem and its line, counted from 1; 0 if the format has no lines.
pub(super) type Fault = (u32, MeshProblem);

/// An error in a mesh file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct MeshError {
    /// Path of the file.
    pub path: PathBuf,
    /// Line of the error, counted from 1; `None` if the format has no lines.
    pub line: Option<u32>,
    /// The problem.
    pub problem: MeshProblem,
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

/// Problems of mesh files.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshProblem {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Read(String),
    /// The file is not in a supported format.
    #[error("not a supported mesh format; convert it to .stl, .obj or .dae")]
    Format,
    /// The file is not UTF-8.
    #[error("not a text file in UTF-8")]
    NotText,
    /// The file contains no triangles.
    #[error("has no triangles")]
    Empty,
    /// A coordinate of a corner is infinite or NaN.
    #[error("a coordinate of a corner is not finite")]
    NotFinite,
    /// The file is truncated.
    #[error("ends after {found} bytes where its header states {expected}")]
    Short {
        /// Length of the file \[bytes\].
        found: usize,
        /// Length according to the header \[bytes\].
        expected: usize,
    },
    /// A token is not a number.
    #[error("found \"{0}\", expected a number")]
    Number(String),
    /// A face refers to a corner that does not exist.
    #[error("a face names corner {index}, {}", corners(*.first, *.count))]
    Index {
        /// Index of the corner as written in the file.
        index: i64,
        /// Index of the first corner in this format: 1 for OBJ, 0 for COLLADA.
        first: i64,
        /// Number of corners.
        count: usize,
    },
    /// A violation of the format that has no separate variant, with its message.
    #[error("{0}")]
    Malformed(String),
}

/// Formats the expected indices of corners.
fn corners(first: i64, count: usize) -> String {
    match count as i64 {
        0 => "but no corner comes before it".to_owned(),
        count => format!("expected {first} to {}", first + count - 1),
    }
}

/// Parses a number.
pub(super) fn number(word: &str) -> Result<f64, MeshProblem> {
    word.parse().map_err(|_| MeshProblem::Number(word.to_owned()))
}
