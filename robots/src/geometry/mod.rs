//! Collision geometry: signed distances between the links of a robot, and between links and obstacles.
//!
//! [`CollisionModel`] prepares the shapes of a [`Model`](crate::Model) once. Meshes become convex hulls or
//! capsules, or remain triangle surfaces. Pairs that cannot collide or are excluded by rules are removed.
//! [`Collisions`] is the workspace for queries of the collision model: distances with the nearest points, and
//! the Jacobians of the distances.
//!
//! Distances are signed: a positive distance is the gap \[m\], a negative distance the penetration depth.
//! Points and normals are in world axes. Normals point from the first solid of a pair to the second.

mod capsule;
mod depth;
mod distance;
mod jacobian;
mod pairs;
mod polygon;
mod robots;
mod search;
mod shape;
mod solid;
pub(crate) mod srdf;
mod support;
mod tree;
mod triangles;
mod witness_room;
mod witnesses;

pub use capsule::fit_capsule;
pub use distance::{Collisions, Proximity};
pub use pairs::{Attachment, CollisionError, CollisionModel, CollisionOptions};
pub use polygon::convex_corners;
pub use shape::ConvexShape;
pub use solid::{MeshMode, SolidKind, SolidProblem};
pub use triangles::{SurfaceEdge, SurfaceTriangle, TriangleSurface, nearest_on_triangle};
