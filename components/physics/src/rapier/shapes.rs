//! Conversion of convex shapes to rapier's shapes, and the filter that rapier applies to pairs of colliders.

use nalgebra::Isometry3;
use rapier3d_f64::geometry::{ColliderHandle, SharedShape, TriMeshFlags};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::{PairFilterContext, PhysicsHooks};
use rapier3d_f64::prelude::SolverFlags;

use super::convert;
use crate::contact::Collider;
use crate::shapes::rapier_shape;

/// Returns the shape of a collider and its frame; its triangles, if it touches by them.
pub(super) fn collider_shape(collider: &Collider) -> Option<(SharedShape, Isometry3<f64>)> {
    let Some(surface) = &collider.surface else { return rapier_shape(&collider.shape) };
    let corners = surface.triangles().iter().flat_map(|triangle| triangle.corners);
    let points: Vec<Vector> = corners.map(|corner| convert::vector(&corner.coords)).collect();
    let triangles = (0..points.len() as u32 / 3).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]);
    // Objects must not catch on the sides between coplanar triangles.
    let flags = TriMeshFlags::FIX_INTERNAL_EDGES | TriMeshFlags::MERGE_DUPLICATE_VERTICES;
    let shape = SharedShape::trimesh_with_flags(points, triangles.collect(), flags).ok()?;
    Some((shape, Isometry3::identity()))
}

/// The pairs of colliders that may touch, as a table.
#[derive(Clone, Debug)]
pub(super) struct PairTable {
    count: usize,
    allowed: Vec<bool>,
}

impl PairTable {
    /// Creates a table for `count` colliders, of which these pairs may touch.
    pub(super) fn new(count: usize, pairs: &[[usize; 2]]) -> Self {
        let mut allowed = vec![false; count * count];
        for [a, b] in pairs {
            allowed[a * count + b] = true;
            allowed[b * count + a] = true;
        }
        Self { count, allowed }
    }
}

/// Rapier calls this for every pair with overlapping bounding boxes. The user data of a collider is its
/// index.
impl PhysicsHooks for PairTable {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        let index = |handle: ColliderHandle| context.colliders[handle].user_data as usize;
        let (first, second) = (index(context.collider1), index(context.collider2));
        self.allowed[first * self.count + second].then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}
