//! Triangle meshes.

use nalgebra::Vector3;

/// A triangle mesh, in the axes of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Positions of the corners \[m\].
    pub points: Vec<Vector3<f64>>,
    /// Indices of the corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Returns the mesh scaled along each axis. If negative factors mirror the mesh, its triangles are
    /// flipped, so that they keep facing outward.
    pub fn scaled(mut self, scale: &Vector3<f64>) -> Self {
        self.points.iter_mut().for_each(|point| point.component_mul_assign(scale));
        if scale.product() < 0.0 {
            // a mirror flips the orientation of the triangles
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self
    }
}
