//! Errors of worlds and of their files.

use std::path::PathBuf;

use motorium_robots::{MeshError, MjcfError, Position, UrdfError, suggestion};

use crate::TerrainError;

/// A mistake in a world description.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A number outside its range.
    #[error("{owner}: `{field}` is {value}, expected {expected}")]
    Value {
        /// The object, `ground` or `world`.
        owner: String,
        /// The field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// The range expected.
        expected: &'static str,
    },
    /// The terrain cannot be generated.
    #[error("terrain: {0}")]
    Terrain(#[from] TerrainError),
    /// A mesh that cannot be used.
    #[error("{owner}: {error}")]
    Mesh {
        /// The object.
        owner: String,
        /// The fault of its file.
        error: MeshError,
    },
    /// A mesh without volume where one is needed.
    #[error("{name}: its mesh is flat and has no convex hull; use its triangles: collision = \"triangles\"")]
    FlatMesh {
        /// The object.
        name: String,
    },
    /// Neighbouring triangles that face opposite sides.
    #[error(
        "{name}: the triangles at the edge from {:?} to {:?} of its mesh face opposite sides, so that nobody knows which side is \
         solid; let all face outward (a mesh editor recalculates normals), or use convex parts, such as \
         collision = {{ parts = 16 }}", .edge[0], .edge[1]
    )]
    TwistedMesh {
        /// The object.
        name: String,
        /// Ends of the edge, in the axes of the mesh \[m\].
        edge: [[f64; 3]; 2],
    },
    /// Triangles that move.
    #[error(
        "{name}: it moves, and cannot touch by its triangles; cut it into convex parts, such as collision = {{ parts = 16 }}, or \
         leave `mass` and `density` out"
    )]
    MovingTriangles {
        /// The object.
        name: String,
    },
    /// Contradictory properties or parts of an object.
    #[error("{name}: {problem}")]
    Parts {
        /// The object.
        name: String,
        /// The problem.
        problem: &'static str,
    },
    /// A connection of unknown objects.
    #[error("`connections` names the object \"{name}\", which the world does not have{}", suggestion(.nearest.as_deref()))]
    NothingToConnect {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// A connection of immovable objects.
    #[error(
        "`connections`: \"{first}\" and \"{second}\" do not move relative to one another: there is nothing to connect"
    )]
    RigidConnection {
        /// A part.
        first: String,
        /// The other.
        second: String,
    },
    /// Two statements of a mass.
    #[error("{name}: both `mass` and `density` are given; leave one out")]
    TwoMasses {
        /// The object.
        name: String,
    },
    /// The file is not a world.
    #[error(transparent)]
    File(#[from] WorldFileError),
    /// A plane and a terrain.
    #[error(
        "both `ground` and `terrain` are given, but a terrain continues beyond its edge; leave `ground` out"
    )]
    TwoGrounds,
    /// A colour for an unknown object.
    #[error("`appearance.colours` names \"{name}\", which the world does not have{}", suggestion(.nearest.as_deref()))]
    NothingToColour {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// Two objects have the same name, or a name is already in use.
    #[error("the object name \"{name}\" is taken by {by}; give the object another name")]
    NameTaken {
        /// The name.
        name: String,
        /// The owner of the name.
        by: &'static str,
    },
}

/// The file cannot be read as a world.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldFileError {
    /// The file cannot be read.
    #[error("{}: {reason}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// Another format.
    #[error("{}: the root element is <{root}>, expected <mujoco>, <robot> or <sdf>; a world in TOML is named by world = \"FILE.toml\"", .path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Its root element.
        root: String,
    },
    /// A fault of an MJCF file.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
    /// A fault of a URDF file.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// An element that a world cannot contain.
    #[error("{}:{}:{}: {problem}", .path.display(), .at.line, .at.column)]
    Problem {
        /// The file.
        path: PathBuf,
        /// Its place.
        at: Position,
        /// The problem.
        problem: String,
    },
}
