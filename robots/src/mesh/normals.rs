//! Normals at the corners of triangles, for viewers.

use std::collections::HashMap;
use std::fmt::Write as _;

use nalgebra::Vector3;

use super::triangle_mesh::TriangleMesh;

/// Cosine of the largest angle between triangles that form one smooth surface: 50 degrees.
const CREASE: f64 = 0.6427876096865394;

impl TriangleMesh {
    /// Returns the normal at each corner of each triangle, for smooth shading. Each normal is the
    /// area-weighted mean of the normals of those triangles around the corner that are tilted by at most 50
    /// degrees from this triangle. The normals of a triangle without area are zero.
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    ///
    /// // Two walls of a box share an edge, and stay flat.
    /// let mesh = TriangleMesh::from_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 -1\nf 1 2 3\nf 2 1 4\n")?;
    /// let normals = mesh.corner_normals();
    /// assert_eq!((normals[0][0].z, normals[1][0].y), (1.0, -1.0));
    /// # Ok::<(), motorium_robots::MeshProblem>(())
    /// ```
    pub fn corner_normals(&self) -> Vec<[Vector3<f64>; 3]> {
        let corner = |index: u32| self.points[index as usize];
        let area = |[a, b, c]: &[u32; 3]| (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a)));
        let areas: Vec<_> = self.triangles.iter().map(area).collect();
        let flat: Vec<_> = areas.iter().map(|area| area.try_normalize(0.0).unwrap_or_default()).collect();
        let mut around = vec![Vec::new(); self.points.len()];
        for (index, triangle) in self.triangles.iter().enumerate() {
            for corner in triangle {
                around[*corner as usize].push(index);
            }
        }
        let normal = |index: usize, corner: u32| {
            let near =
                around[corner as usize].iter().filter(|other| flat[**other].dot(&flat[index]) > CREASE);
            let sum: Vector3<f64> = near.map(|other| areas[*other]).sum();
            sum.try_normalize(0.0).unwrap_or(flat[index])
        };
        let corners = self.triangles.iter().enumerate();
        corners.map(|(index, triangle)| triangle.map(|corner| normal(index, corner))).collect()
    }

    /// Returns the mesh as the text of a Wavefront OBJ file with [normals](Self::corner_normals). Coordinates
    /// are rounded to a micrometre.
    pub fn to_shaded_obj(&self) -> String {
        let (mut text, mut faces) = (String::new(), String::new());
        for point in &self.points {
            let _ = writeln!(text, "v {:.6} {:.6} {:.6}", point.x, point.y, point.z);
        }
        let mut known = HashMap::new();
        for (triangle, normals) in self.triangles.iter().zip(self.corner_normals()) {
            faces.push('f');
            for (corner, normal) in triangle.iter().zip(normals) {
                let line = format!("vn {:.4} {:.4} {:.4}\n", normal.x, normal.y, normal.z);
                let next = known.len() + 1;
                let index = *known.entry(line).or_insert_with_key(|line| {
                    text += line;
                    next
                });
                let _ = write!(faces, " {}//{index}", corner + 1);
            }
            faces.push('\n');
        }
        text + &faces
    }
}
