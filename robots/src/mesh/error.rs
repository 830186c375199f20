//! Errors of mesh files.

use std::fmt;
use std::path::PathBuf;

/// A problem and its line, counted from 1; 0 where the format has no lines.
pub(super) type Fault = (u32, MeshProblem);

/// An error of reading a mesh file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct MeshError {
    /// The file.
    pub path: PathBuf,
    /// Line at fault, counted from 1.
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
    /// Another kind of file.
    #[error("not a mesh format that can be read; convert it to .stl, .obj or .dae")]
    Format,
    /// Not UTF-8.
    #[error("not a text file in UTF-8")]
    NotText,
    /// A file without triangles.
    #[error("has no triangles")]
    Empty,
    /// A corner is infinite or not a number.
    #[error("a corner is not a finite number")]
    NotFinite,
    /// The file ends prematurely.
    #[error("ends after {found} bytes where its header promises {expected}")]
    Short {
        /// Length of the file \[bytes\].
        found: usize,
        /// Length that its header promises \[bytes\].
        expected: usize,
    },
    /// A word is not a number.
    #[error("\"{0}\" is not the number expected there")]
    Number(String),
    /// The corner does not exist.
    #[error("names corner {index} of {count}")]
    Index {
        /// Corner named, counted from 0.
        index: i64,
        /// Number of corners.
        count: usize,
    },
    /// Another breach of the format.
    #[error("{0}")]
    Malformed(String),
}

/// Parses a number.
pub(super) fn number(word: &str) -> Result<f64, MeshProblem> {
    word.parse().map_err(|_| MeshProblem::Number(word.to_owned()))
}
