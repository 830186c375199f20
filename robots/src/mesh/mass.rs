//! Volume, centre and inertia of meshes.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::triangle_mesh::TriangleMesh;

/// Volume, centre of mass and inertia of a solid with uniform density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeProperties {
    /// Volume \[m3\].
    pub volume: f64,
    /// Centre of mass, in the axes of the mesh \[m\].
    pub centre: Vector3<f64>,
    /// Inertia about the centre of mass per unit of mass, in the axes of the mesh \[m2\].
    pub inertia: Matrix3<f64>,
}

impl VolumeProperties {
    /// Returns the pose of the principal axes of inertia, with the centre of mass as origin, and the
    /// principal moments per unit of mass \[m2\].
    pub fn principal(&self) -> (Isometry3<f64>, Vector3<f64>) {
        let eigen = self.inertia.symmetric_eigen();
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.set_column(2, &-axes.column(2));
        }
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        (Isometry3::from_parts(Translation3::from(self.centre), turn), eigen.eigenvalues)
    }
}

impl TriangleMesh {
    /// Returns the mesh with coincident corners merged and degenerate triangles removed.
    pub fn welded(&self) -> Self {
        let mut places: HashMap<[u64; 3], u32> = HashMap::new();
        let mut points = Vec::new();
        let mut place = |index: u32| {
            let point = self.points[index as usize];
            // minus zero equals zero
            let bits = [point.x + 0.0, point.y + 0.0, point.z + 0.0].map(f64::to_bits);
            *places.entry(bits).or_insert_with(|| {
                points.push(point);
                points.len() as u32 - 1
            })
        };
        let triangles = self.triangles.iter().map(|triangle| triangle.map(&mut place));
        let triangles: Vec<_> = triangles.filter(|[a, b, c]| a != b && b != c && a != c).collect();
        Self { points, triangles }
    }

    /// Returns `true` if the mesh encloses a volume: every edge borders two triangles that traverse it in
    /// opposite directions, and triangles face outward. Coincident corners must be merged first: see
    /// [`welded`](Self::welded).
    pub fn is_closed(&self) -> bool {
        self.is_without_rim() && self.volume() > 0.0
    }

    /// Returns `true` if the mesh is closed and fills its convex hull up to a millionth of the volume.
    /// Coincident corners need not be merged.
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    /// use nalgebra::Vector3;
    ///
    /// let points = vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    /// let closed = TriangleMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
    /// let open = TriangleMesh { triangles: closed.triangles[1..].to_vec(), ..closed.clone() };
    /// assert!(closed.is_convex() && !open.is_convex());
    /// ```
    pub fn is_convex(&self) -> bool {
        let mesh = self.welded().facing_outward();
        let volume = |mesh: &Self| mesh.volume_properties().map_or(0.0, |solid| solid.volume);
        let hull = mesh.hull(usize::MAX).map_or(f64::INFINITY, |hull| volume(&hull));
        mesh.is_without_rim() && volume(&mesh) >= (1.0 - 1e-6) * hull
    }

    /// Returns the mesh with outward-facing triangles: if the mesh encloses a volume and its triangles face
    /// inward, all triangles are flipped. Coincident corners must be merged first: see
    /// [`welded`](Self::welded).
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    /// use nalgebra::Vector3;
    ///
    /// let points = vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    /// let inward = TriangleMesh { points, triangles: vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]] };
    /// assert!(inward.volume() < 0.0 && inward.facing_outward().is_closed());
    /// ```
    #[must_use]
    pub fn facing_outward(mut self) -> Self {
        if self.is_without_rim() && self.volume() < 0.0 {
            self.triangles.iter_mut().for_each(|[_, b, c]| core::mem::swap(b, c));
        }
        self
    }

    /// Returns the ends \[m\] of an edge that two triangles traverse in the same direction, because their
    /// orientations are inconsistent. Returns `None` if all orientations are consistent. Coincident corners
    /// must be merged first: see [`welded`](Self::welded).
    pub fn twisted_edge(&self) -> Option<[Vector3<f64>; 2]> {
        let edges = self.directed_edges();
        let twisted = |(from, to): &(u32, u32), count: i32| count == 2 && !edges.contains_key(&(*to, *from));
        let found = edges.iter().filter(|(edge, count)| twisted(edge, **count)).map(|(edge, _)| *edge);
        found.min().map(|(from, to)| [from, to].map(|index| self.points[index as usize]))
    }

    /// Number of triangles along each directed edge.
    fn directed_edges(&self) -> HashMap<(u32, u32), i32> {
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for [a, b, c] in &self.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry((from, to)).or_default() += 1;
            }
        }
        edges
    }

    /// Returns `true` if each edge has the same number of triangles in both directions.
    fn is_without_rim(&self) -> bool {
        let edges = self.directed_edges();
        let paired = |((from, to), count): (&(u32, u32), &i32)| edges.get(&(*to, *from)) == Some(count);
        !edges.is_empty() && edges.iter().all(paired)
    }

    /// Returns the volume, centre of mass and inertia of the solid enclosed by a [closed](Self::is_closed)
    /// mesh.
    ///
    /// ```
    /// use motorium_robots::TriangleMesh;
    /// use nalgebra::Vector3;
    ///
    /// let corner = |x, y, z| Vector3::new(x, y, z);
    /// let points = vec![corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)];
    /// let pyramid = TriangleMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
    /// assert!(pyramid.is_closed());
    /// let solid = pyramid.volume_properties().unwrap();
    /// assert!((solid.volume - 1.0 / 6.0).abs() < 1e-15);
    /// assert!((solid.centre - Vector3::repeat(0.25)).norm() < 1e-15);
    /// ```
    ///
    /// Returns `None` if the volume is not positive.
    pub fn volume_properties(&self) -> Option<VolumeProperties> {
        // Relative to a corner of the mesh, to avoid losing digits far from the origin.
        let origin = self.points[self.triangles.first()?[0] as usize];
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|index| self.points[index as usize] - origin);
            // The tetrahedron of the triangle and the origin.
            let six = a.dot(&b.cross(&c));
            let sum = a + b + c;
            volume += six / 6.0;
            first += sum * (six / 24.0);
            let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
            second += (sum * sum.transpose() + squares) * (six / 120.0);
        }
        if !(volume > 0.0 && volume.is_finite()) {
            return None;
        }
        let centre = first / volume;
        let spread = second / volume - centre * centre.transpose();
        let inertia = Matrix3::from_diagonal_element(spread.trace()) - spread;
        Some(VolumeProperties { volume, centre: centre + origin, inertia })
    }
}
