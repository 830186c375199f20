//! Triangle meshes, read from STL, Wavefront OBJ and COLLADA files.

mod collada;
mod decompose;
mod ears;
mod hull;
mod mass;
mod obj;
mod stl;

use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use crate::file::read_bounded;
pub use mass::VolumeProperties;

/// A triangle mesh, in the axes of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Positions of the corners \[m\].
    pub points: Vec<Vector3<f64>>,
    /// Indices of the corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Longest file of a mesh, bytes.
const LONGEST: u64 = 512 * 1024 * 1024;

impl TriangleMesh {
    /// Reads an `.stl` (text or binary), `.obj` or `.dae` file.
    ///
    /// Lengths in STL and OBJ files are metres. The `unit` of a COLLADA file is applied, its `up_axis` is
    /// not, as in RViz, Gazebo and Pinocchio.
    ///
    /// # Errors
    ///
    /// [`MeshError`], with the line where the format has lines.
    pub fn read(path: &Path) -> Result<Self, MeshError> {
        let error = |line, problem| MeshError { path: path.to_owned(), line, problem };
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        let bytes = read_bounded(path, LONGEST)
            .map_err(|source| error(None, MeshProblem::Read(source.to_string())))?;
        let text = || std::str::from_utf8(&bytes).map_err(|_| (0, MeshProblem::NotText));
        let mesh = match extension.as_deref() {
            Some("stl") => stl::parse(&bytes),
            Some("obj") => text().and_then(obj::parse),
            Some("dae") => text().and_then(collada::parse),
            _ => Err((0, MeshProblem::Format)),
        };
        let mesh = mesh.map_err(|(line, problem)| error((line > 0).then_some(line), problem))?;
        if mesh.triangles.is_empty() {
            return Err(error(None, MeshProblem::Empty));
        }
        if mesh.points.iter().any(|point| !point.iter().all(|x| x.is_finite())) {
            return Err(error(None, MeshProblem::NotFinite));
        }
        Ok(mesh)
    }

    /// The mesh scaled along each axis, its triangles facing outward as before.
    pub fn scaled(mut self, scale: &Vector3<f64>) -> Self {
        self.points.iter_mut().for_each(|point| point.component_mul_assign(scale));
        if scale.product() < 0.0 {
            // A mirror turns the triangles inside out.
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self
    }
}

/// A problem and its line, counted from 1; 0 where the format has no lines.
type Fault = (u32, MeshProblem);

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

fn number(word: &str) -> Result<f64, MeshProblem> {
    word.parse().map_err(|_| MeshProblem::Number(word.to_owned()))
}
