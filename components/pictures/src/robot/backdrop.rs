//! The world around robots: its objects and its terrain.

use std::sync::Arc;

use motorium_robots::{Geometry, TriangleMesh};
use motorium_worlds::{ObjectShape, World};
use nalgebra::{Isometry3, Vector3};

use super::solid::{Detail, Form, Solid};
use super::terrain::terrain_mesh;

/// Extent from which a solid counts as a wall or a floor rather than as an object \[m\].
const LARGE: f64 = 3.0;

/// The visible parts of a world.
#[derive(Debug)]
pub(super) struct Backdrop {
    /// Index of an object, frame in it, and a part whose pose is the identity.
    parts: Vec<(usize, Isometry3<f64>, Solid)>,
    terrain: Option<Solid>,
}

impl Backdrop {
    pub(super) fn new(world: &World) -> Self {
        let solid = |geometry: &Geometry, colour| {
            let form = Form::from_geometry(geometry, Detail::Full)?;
            Some(Solid { pose: Isometry3::identity(), form, colour })
        };
        let mut parts = Vec::new();
        for (index, object) in world.objects.iter().enumerate() {
            let colour = world.appearance.object(object);
            for (frame, geometry) in visible(&object.shape) {
                parts.extend(solid(&geometry, colour).map(|solid| (index, frame, solid)));
            }
        }
        // The files may have changed since the run.
        let field = world.height_field().ok().flatten();
        let terrain = field.and_then(|field| {
            solid(&mesh("terrain".to_owned(), terrain_mesh(&field)), world.appearance.ground())
        });
        Self { parts, terrain }
    }

    /// Returns the solids of the world, with the objects at these poses.
    pub(super) fn solids(&self, poses: &[Isometry3<f64>]) -> Vec<Solid> {
        let placed = self.parts.iter().filter_map(|(index, frame, solid)| {
            Some(Solid { pose: poses.get(*index)? * frame, ..solid.clone() })
        });
        placed.chain(self.terrain.clone()).collect()
    }

    /// Returns the objects of the world to frame in a picture, without walls and floors, at these poses.
    pub(super) fn things(&self, poses: &[Isometry3<f64>]) -> Vec<Solid> {
        let mut solids = self.solids(poses);
        solids.truncate(self.parts.len());
        solids.retain(|solid| solid.extent() < LARGE);
        solids
    }
}

/// Returns the visible shapes of an object. For a mesh, these are its visual and not its collision parts.
fn visible(shape: &ObjectShape) -> Vec<(Isometry3<f64>, Geometry)> {
    match shape {
        ObjectShape::Mesh(shape) => {
            let Ok(body) = shape.body() else { return Vec::new() };
            let mut whole = TriangleMesh::default();
            for triangle in body.visual.triangles() {
                let first = whole.points.len() as u32;
                whole.points.extend(triangle.corners.iter().map(|at| Vector3::new(at.x, at.y, at.z)));
                whole.triangles.push([first, first + 1, first + 2]);
            }
            vec![(Isometry3::identity(), mesh(shape.file.display().to_string(), whole))]
        }
        ObjectShape::Compound(_) => {
            let placed = |(frame, part): (Isometry3<f64>, &ObjectShape)| {
                let within = visible(part).into_iter();
                within.map(|(within, geometry)| (frame * within, geometry)).collect::<Vec<_>>()
            };
            shape.shapes().into_iter().flat_map(placed).collect()
        }
        simple => simple.geometries(),
    }
}

fn mesh(uri: String, mesh: TriangleMesh) -> Geometry {
    Geometry::Mesh { uri, path: None, inline: Some(Arc::new(mesh)), scale: Vector3::repeat(1.0) }
}
