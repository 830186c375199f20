//! Helpers for reading world files of all formats: positions, errors, meshes and names.

use std::path::Path;

use motorium_robots::{BasePose, ModelWarning, Position, TriangleMesh};
use nalgebra::Isometry3;
use roxmltree::Node;

use super::{MeshCollision, MeshShape, Object, ObjectShape, World, WorldFileError};

/// The world of a file, and its skipped elements.
pub(super) struct Read {
    pub(super) world: World,
    pub(super) states_gravity: bool,
    pub(super) warnings: Vec<ModelWarning>,
}

/// Returns the position of an element.
pub(super) fn position(node: Node<'_, '_>) -> Position {
    let at = node.document().text_pos_at(node.range().start);
    Position { line: at.row, column: at.col }
}

/// Creates an error at an element.
pub(super) fn problem(path: &Path, node: Node<'_, '_>, problem: impl Into<String>) -> WorldFileError {
    let at = position(node);
    WorldFileError::Problem { path: path.to_owned(), at, problem: problem.into() }
}

/// Returns the shape of a mesh of a file, and the reason for a warning.
///
/// The simulator of the file uses its triangles for collision. So does this crate for fixed meshes, unless
/// they are convex, in which case the hull is equivalent. Moving objects collide with the hull.
pub(super) fn mesh(path: &Path, scale: [f64; 3], moves: bool) -> (ObjectShape, Option<&'static str>) {
    let file = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    // A file that cannot be read is reported by the check of the object.
    let read = TriangleMesh::read(&file).ok().filter(|mesh| !mesh.is_convex());
    let (collision, reason) = match read {
        None => (MeshCollision::Hull, None),
        Some(_) if moves => {
            (MeshCollision::Hull, Some("a moving object collides with the convex hull of its mesh"))
        }
        Some(mesh) if mesh.welded().twisted_edge().is_some() => (
            MeshCollision::Hull,
            Some(
                "the mesh collides as its convex hull, because its triangles face both sides; orient all \
                 triangles outward",
            ),
        ),
        Some(_) => (MeshCollision::Triangles, None),
    };
    (ObjectShape::Mesh(MeshShape { scale, collision, ..MeshShape::new(file) }), reason)
}

pub(super) fn fixed(name: String, shape: ObjectShape, pose: &Isometry3<f64>) -> Object {
    let BasePose { position, rpy } = BasePose::from_isometry(pose);
    Object { name, shape, position, rpy, ..Object::default() }
}

/// Returns a name, with a number appended if it is in use.
pub(super) fn unique(world: &World, name: &str) -> String {
    let taken = |name: &str| world.objects.iter().any(|object| object.name == name);
    if !taken(name) {
        return name.to_owned();
    }
    (2..).map(|number| format!("{name}_{number}")).find(|name| !taken(name)).unwrap_or_default()
}
