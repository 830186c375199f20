//! Triangle meshes, read from STL, Wavefront OBJ and COLLADA files.

mod collada;
mod decompose;
mod ears;
mod error;
mod hull;
mod mass;
mod normals;
mod obj;
mod stl;
mod triangle_mesh;

use std::path::Path;

use crate::file::read_bounded;
pub use error::{MeshError, MeshProblem};
pub use mass::VolumeProperties;
pub use triangle_mesh::TriangleMesh;

/// Maximum size of a mesh file, bytes.
const LONGEST: u64 = 512 * 1024 * 1024;

impl TriangleMesh {
    /// Creates a mesh from the text of a Wavefront OBJ file. Lengths are in metres.
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    ///
    /// let mesh = TriangleMesh::from_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")?;
    /// assert_eq!(mesh.triangles.len(), 2);
    /// # Ok::<(), motorium_robots::MeshProblem>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`MeshProblem`] if the text is not a valid OBJ file with triangles.
    pub fn from_obj(text: &str) -> Result<Self, MeshProblem> {
        obj::parse(text).map_err(|(_, problem)| problem)
    }

    /// Reads a mesh from an `.stl` (text or binary), `.obj` or `.dae` file.
    ///
    /// Lengths in STL and OBJ files are in metres. The `unit` of a COLLADA file is applied, but its `up_axis`
    /// is not, as in RViz, Gazebo and Pinocchio.
    ///
    /// # Errors
    ///
    /// [`MeshError`], with the line number if the format has lines.
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
}
