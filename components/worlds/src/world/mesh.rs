//! Objects with mesh shapes.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use motorium_robots::{Geometry, MeshError, TriangleMesh, TriangleSurface, VolumeProperties};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::WorldError;
use super::checks::check;

/// Maximum number of corners of a convex part of a mesh.
const MOST_CORNERS: usize = 64;

/// Maximum number of corners of the convex hull of a mesh.
const MOST_HULL_CORNERS: usize = 4096;

/// Maximum number of convex parts of a mesh.
const MOST_PARTS: usize = 64;

/// An object's shape read from a mesh file, in the coordinates of the file.
///
/// ```
/// use motorium_worlds::{MeshCollision, MeshShape, Object, ObjectShape};
///
/// let text = r#"
/// name     = "mug"
/// shape    = { mesh = { file = "mug.obj", scale = [0.001, 0.001, 0.001], collision = { parts = 12 } } }
/// density  = 2400.0
/// position = [0.5, 0.0, 0.1]
/// "#;
/// let mug: Object = toml::from_str(text).unwrap();
/// let ObjectShape::Mesh(mesh) = &mug.shape else { panic!("a mesh") };
/// assert_eq!(mesh.collision, MeshCollision::Parts(12));
/// ```
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshShape {
    /// File of the mesh: `.stl`, `.obj` or `.dae`. Relative paths start at the graph's folder.
    #[schemars(extend("format" = "path"))]
    pub file: PathBuf,
    /// Scale along x, y and z, not 0. A negative value mirrors the mesh. Default 1, for a file in metres.
    #[serde(default = "unscaled")]
    pub scale: [f64; 3],
    /// Collision shape. Default: the convex hull.
    #[serde(default)]
    pub collision: MeshCollision,
    /// Mesh file for drawing, if it differs from `file`. The same `scale` applies. Default: `file`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"))]
    pub visual: Option<PathBuf>,
    /// The body read from the file, or the error. Read once and shared by all copies.
    #[serde(skip)]
    pub(crate) read: Arc<OnceLock<Result<Arc<MeshBody>, MeshError>>>,
}

/// Collision shape of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshCollision {
    /// Convex hull of at most 4096 corners.
    #[default]
    Hull,
    /// Convex parts that together cover the mesh: at most this number of parts (1 to 64), each with at most
    /// 64 corners. The parts protrude from the mesh by up to a 64th of the mesh's longest side.
    Parts(#[schemars(range(min = 1, max = 64))] usize),
    /// The triangles of the mesh, solid behind their front side. This shape is exact, but only fixed objects
    /// can have it. Triangles that enclose a volume face outward, regardless of their order in the file. The
    /// front of an open surface is the side from which its triangles are counter-clockwise.
    Triangles,
}

/// A loaded mesh with its collision parts and mass properties.
#[derive(Debug)]
pub struct MeshBody {
    /// Mesh of the file, scaled, with coincident corners merged and triangles facing outward.
    pub mesh: TriangleMesh,
    /// Triangles for drawing the mesh and for the rays of sensors.
    pub visual: Arc<TriangleSurface>,
    /// Convex collision parts; empty for triangle collision.
    pub parts: Vec<Arc<TriangleMesh>>,
    /// Triangles for triangle collision; `None` for collision of convex parts.
    pub surface: Option<Arc<TriangleSurface>>,
    /// Volume properties of the mesh if it is closed, otherwise of its convex hull; `None` without a volume.
    pub properties: Option<VolumeProperties>,
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}

impl PartialEq for MeshShape {
    fn eq(&self, other: &Self) -> bool {
        let settings = |mesh: &Self| (mesh.file.clone(), mesh.scale, mesh.collision, mesh.visual.clone());
        settings(self) == settings(other)
    }
}

impl MeshShape {
    /// Creates a mesh shape from a file. The shape collides with the convex hull of the mesh.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        let (scale, collision) = (unscaled(), MeshCollision::default());
        Self { file: file.into(), scale, collision, visual: None, read: Arc::default() }
    }

    /// Creates a mesh shape from a mesh in memory; `name` is used in place of a file name.
    pub fn of_mesh(name: &str, mesh: TriangleMesh, collision: MeshCollision) -> Self {
        let shape = Self { collision, ..Self::new(name) };
        let _ = shape.read.set(Ok(Arc::new(MeshBody::new(mesh, None, collision))));
        shape
    }

    /// Resolves relative paths from a folder.
    pub(super) fn locate(&mut self, folder: &Path) {
        if self.read.get().is_some_and(Result::is_ok) {
            return;
        }
        self.file = folder.join(&self.file);
        self.visual = self.visual.as_ref().map(|file| folder.join(file));
        self.read = Arc::default();
    }

    /// Returns the mesh with its parts and mass properties. The first call reads the file.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if a file cannot be read as a mesh.
    pub fn body(&self) -> Result<Arc<MeshBody>, MeshError> {
        self.read.get_or_init(|| self.read_files().map(Arc::new)).clone()
    }

    fn read_files(&self) -> Result<MeshBody, MeshError> {
        let scale = Vector3::from(self.scale);
        let read = |file: &Path| TriangleMesh::read(file).map(|mesh| mesh.scaled(&scale));
        let visual = self.visual.as_deref().map(read).transpose()?;
        Ok(MeshBody::new(read(&self.file)?, visual, self.collision))
    }

    /// Checks numbers and files.
    pub(super) fn check(&self, owner: &str, moves: bool) -> Result<(), WorldError> {
        for scale in self.scale {
            let good = scale.is_finite() && scale != 0.0;
            check(owner, "scale", scale, good, "a number other than 0")?;
        }
        if let MeshCollision::Parts(parts) = self.collision {
            let good = (1..=MOST_PARTS).contains(&parts);
            check(owner, "parts", parts as f64, good, "a whole number from 1 to 64")?;
        }
        if moves && self.collision == MeshCollision::Triangles {
            return Err(WorldError::MovingTriangles { name: owner.to_owned() });
        }
        let error = |error| WorldError::Mesh { owner: owner.to_owned(), error };
        let body = self.body().map_err(error)?;
        let flat = body.properties.is_none() || body.parts.is_empty();
        if flat && self.collision != MeshCollision::Triangles {
            return Err(WorldError::FlatMesh { name: owner.to_owned() });
        }
        if self.collision == MeshCollision::Triangles
            && let Some(edge) = body.mesh.twisted_edge()
        {
            let name = owner.to_owned();
            return Err(WorldError::TwistedMesh { name, edge: edge.map(Into::into) });
        }
        Ok(())
    }
}

impl MeshBody {
    fn new(mesh: TriangleMesh, visual: Option<TriangleMesh>, collision: MeshCollision) -> Self {
        let mesh = mesh.welded().facing_outward();
        let closed = if mesh.is_closed() { mesh.volume_properties() } else { None };
        let of_hull = || mesh.hull(usize::MAX).and_then(|hull| hull.volume_properties());
        let properties = closed.or_else(of_hull);
        let parts = match collision {
            MeshCollision::Hull => mesh.convex_parts(1, MOST_HULL_CORNERS),
            MeshCollision::Parts(parts) => mesh.convex_parts(parts.clamp(1, MOST_PARTS), MOST_CORNERS),
            MeshCollision::Triangles => Vec::new(),
        };
        let visual = Arc::new(TriangleSurface::new(visual.as_ref().unwrap_or(&mesh)));
        let touches = collision == MeshCollision::Triangles;
        let surface = touches.then(|| Arc::new(TriangleSurface::new(&mesh)));
        let parts = parts.into_iter().map(Arc::new).collect();
        Self { mesh, visual, parts, surface, properties }
    }

    /// Returns the collision shapes, each in the frame of the mesh.
    pub fn geometries(&self, name: &str) -> Vec<Geometry> {
        let of = |mesh: Arc<TriangleMesh>| Geometry::Mesh {
            uri: name.to_owned(),
            path: None,
            inline: Some(mesh),
            scale: Vector3::repeat(1.0),
        };
        match &self.surface {
            Some(_) => vec![of(Arc::new(self.mesh.clone()))],
            None => self.parts.iter().cloned().map(of).collect(),
        }
    }
}
