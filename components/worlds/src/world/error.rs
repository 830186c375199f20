//! Errors of worlds and of their files.

use std::path::PathBuf;

use motorium_robots::{MeshError, MjcfError, Position, UrdfError, suggestion};

use crate::TerrainError;

/// The description of a world has an error.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A number is out of range.
    #[error("{owner}: `{field}` is {value}, expected {expected}")]
    Value {
        /// The object, `ground` or `world`.
        owner: String,
        /// Name of the field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// The range expected.
        expected: &'static str,
    },
    /// The terrain cannot be generated.
    #[error("terrain: {0}")]
    Terrain(#[from] TerrainError),
    /// A mesh is unusable.
    #[error("{owner}: {error}")]
    Mesh {
        /// Name of the object.
        owner: String,
        /// Error of the mesh file.
        error: MeshError,
    },
    /// A mesh has no volume, so no convex hull can be computed.
    #[error("{name}: its mesh is flat and has no convex hull; use its triangles: collision = \"triangles\"")]
    FlatMesh {
        /// Name of the object.
        name: String,
    },
    /// Neighbouring triangles of a mesh face opposite sides.
    #[error(
        "{name}: the triangles at the edge from {:?} to {:?} of its mesh face opposite sides, so it is ambiguous which side is \
         solid; orient all of them outward (a mesh editor recalculates normals), or use convex parts, such as \
         collision = {{ parts = 16 }}", .edge[0], .edge[1]
    )]
    TwistedMesh {
        /// Name of the object.
        name: String,
        /// Ends of the edge, in the axes of the mesh \[m\].
        edge: [[f64; 3]; 2],
    },
    /// A moving object uses triangle collision.
    #[error(
        "{name}: a moving object cannot collide with its triangles; cut the mesh into convex parts, such as \
         collision = {{ parts = 16 }}, or \
         remove `mass` and `density`"
    )]
    MovingTriangles {
        /// Name of the object.
        name: String,
    },
    /// Properties or parts of an object are contradictory.
    #[error("{name}: {problem}")]
    Parts {
        /// Name of the object.
        name: String,
        /// The problem.
        problem: &'static str,
    },
    /// A connection refers to an unknown object.
    #[error("`connections` names the object \"{name}\", which is not in the world{}", suggestion(.nearest.as_deref()))]
    NothingToConnect {
        /// The unknown name.
        name: String,
        /// The closest known name.
        nearest: Option<String>,
    },
    /// A connection joins immovable objects.
    #[error(
        "`connections`: \"{first}\" and \"{second}\" do not move relative to each other, so there is nothing to connect"
    )]
    RigidConnection {
        /// First part.
        first: String,
        /// Second part.
        second: String,
    },
    /// Both mass and density are specified.
    #[error("{name}: both `mass` and `density` are given; remove one")]
    TwoMasses {
        /// Name of the object.
        name: String,
    },
    /// The file cannot be read as a world.
    #[error(transparent)]
    File(#[from] WorldFileError),
    /// Both a plane and a terrain are specified.
    #[error(
        "both `ground` and `terrain` are given, but a terrain continues beyond its edge; remove `ground`"
    )]
    TwoGrounds,
    /// A colour refers to an unknown object.
    #[error("`appearance.colours` names \"{name}\", which is not in the world{}", suggestion(.nearest.as_deref()))]
    NothingToColour {
        /// The unknown name.
        name: String,
        /// The closest known name.
        nearest: Option<String>,
    },
    /// Two objects have the same name, or a name is already in use.
    #[error("the object name \"{name}\" is taken by {by}; give the object another name")]
    NameTaken {
        /// The duplicate name.
        name: String,
        /// Existing use of the name.
        by: &'static str,
    },
}

/// The file cannot be read as a world.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldFileError {
    /// The file cannot be opened or read.
    #[error("{}: {reason}", .path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the failure.
        reason: String,
    },
    /// The file is not in a supported format.
    #[error("{}: the root element is <{root}>, expected <mujoco>, <robot> or <sdf>; use world = \"FILE.toml\" for a world in TOML", .path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Root element of the file.
        root: String,
    },
    /// The MJCF file has an error.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
    /// The URDF file has an error.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// The file contains an element that a world cannot represent.
    #[error("{}:{}:{}: {problem}", .path.display(), .at.line, .at.column)]
    Problem {
        /// Path of the file.
        path: PathBuf,
        /// Position of the element.
        at: Position,
        /// The problem.
        problem: String,
    },
}
