//! Convex parts of meshes, and export of meshes.

use std::fmt::Write as _;

use nalgebra::Vector3;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};

use super::triangle_mesh::TriangleMesh;
use crate::math::{V3, v3, vector};

/// Number of voxels along the longest side of a mesh that is decomposed.
const RESOLUTION: u32 = 64;

impl TriangleMesh {
    /// Returns convex meshes that together cover the mesh: at most `most_parts` meshes with at most
    /// `most_corners` corners each. If `most_parts` is 1, the result is the [`hull`](Self::hull). Otherwise
    /// the meshes are the hulls of a V-HACD decomposition (Mamou 2016) on a grid with 64 voxels along the
    /// longest side. These hulls therefore protrude from the mesh by up to a voxel.
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    /// use nalgebra::Vector3;
    ///
    /// let corner = |x, y, z| Vector3::new(x, y, z);
    /// let points = vec![corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)];
    /// let pyramid = TriangleMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
    /// let parts = pyramid.convex_parts(1, 64);
    /// assert_eq!((parts.len(), parts[0].points.len()), (1, 4));
    /// ```
    pub fn convex_parts(&self, most_parts: usize, most_corners: usize) -> Vec<Self> {
        if most_parts <= 1 {
            return self.hull(most_corners).into_iter().collect();
        }
        let points: Vec<_> = self.points.iter().map(|point| vector(V3::from(*point))).collect();
        let settings = VHACDParameters {
            resolution: RESOLUTION,
            max_convex_hulls: u32::try_from(most_parts).unwrap_or(u32::MAX),
            ..VHACDParameters::default()
        };
        let cut = VHACD::decompose(&settings, &points, &self.triangles, false);
        let parts = cut.compute_convex_hulls(1).into_iter();
        parts
            .filter_map(|(points, triangles)| {
                let points = points.into_iter().map(|point| Vector3::from(v3(point))).collect();
                Self { points, triangles }.hull(most_corners)
            })
            .collect()
    }

    /// Returns the volume enclosed by a closed mesh whose triangles face outward \[m3\].
    pub fn volume(&self) -> f64 {
        let corner = |index: u32| self.points[index as usize];
        let of = |[a, b, c]: &[u32; 3]| corner(*a).dot(&corner(*b).cross(&corner(*c))) / 6.0;
        self.triangles.iter().map(of).sum()
    }

    /// Returns the mesh as the text of a Wavefront OBJ file. Coordinates are rounded to a micrometre.
    pub fn to_obj(&self) -> String {
        let mut text = String::new();
        for point in &self.points {
            let _ = writeln!(text, "v {:.6} {:.6} {:.6}", point.x, point.y, point.z);
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        text
    }
}
