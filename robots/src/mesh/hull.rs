//! Convex hulls of meshes.

use nalgebra::Vector3;
use parry3d_f64::transformation::try_convex_hull;

use super::triangle_mesh::TriangleMesh;
use crate::math::{V3, v3, vector};

/// The golden angle \[rad\]: points of a sphere rotated by it from one height to the next are distributed
/// evenly (Vogel 1979).
const GOLDEN: f64 = 2.399_963_229_728_653;

impl TriangleMesh {
    /// Returns the convex hull of the mesh, with triangles that face outward. Corners that belong to no
    /// triangle are ignored. If the hull has more than `most_corners` corners, the result is the hull of
    /// those corners that are farthest along `most_corners` directions. This smaller hull is inscribed in the
    /// full hull.
    ///
    /// Returns `None` for a flat mesh, whose hull has no volume.
    pub fn hull(&self, most_corners: usize) -> Option<Self> {
        let corners: Vec<_> = self.used().map(|point| vector(V3::from(point))).collect();
        let (mut points, mut triangles) = try_convex_hull(&corners).ok()?;
        if points.len() > most_corners {
            let coarse: Vec<_> = directions(most_corners)
                .filter_map(|direction| {
                    let along = |point: &parry3d_f64::math::Vector| v3(*point).dot(direction);
                    points.iter().copied().max_by(|a, b| along(a).total_cmp(&along(b)))
                })
                .collect();
            (points, triangles) = try_convex_hull(&coarse).ok()?;
        }
        let points = points.into_iter().map(|point| Vector3::from(v3(point))).collect();
        Some(Self { points, triangles })
    }

    /// Iterates over the corners used by triangles.
    pub(crate) fn used(&self) -> impl Iterator<Item = Vector3<f64>> {
        let mut used = vec![false; self.points.len()];
        self.triangles.iter().flatten().for_each(|&corner| used[corner as usize] = true);
        self.points.iter().zip(used).filter_map(|(point, used)| used.then_some(*point))
    }
}

/// Returns unit vectors distributed evenly over the sphere.
fn directions(count: usize) -> impl Iterator<Item = V3> {
    (0..count).map(move |index| {
        let height = (2.0 * index as f64 + 1.0) / count as f64 - 1.0;
        let radius = (1.0 - height * height).sqrt();
        let (sin, cos) = (GOLDEN * index as f64).sin_cos();
        V3::new(radius * cos, radius * sin, height)
    })
}
