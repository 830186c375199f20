//! Faces of convex colliders, in contact with points and edges of others.

use motorium_robots::ConvexShape;
use nalgebra::Vector3;

use super::colliders::Collider;
use super::features::ContactGeometry;

/// A point closer than this to an edge of a hull may belong to either face \[m\].
const EDGE_BAND: f64 = 1e-3;

/// A point above a face is at most this far outside the other faces \[m\].
const BESIDE: f64 = 1e-5;

/// Largest number of planes: a cylinder with eight sides has ten, a box six.
pub(super) const SIDES: usize = 10;

impl Collider {
    /// Returns the outward normal of the face that a point beyond the surface is in front of most.
    pub(super) fn away(&self, point: &Vector3<f64>) -> Option<Vector3<f64>> {
        if self.faces.is_empty() {
            return self.shape.surface(point).map(|(_, away)| away);
        }
        let height = |face: &&(Vector3<f64>, f64)| face.0.dot(point) - face.1;
        self.faces.iter().max_by(|a, b| height(a).total_cmp(&height(b))).map(|(normal, _)| *normal)
    }

    /// Returns [`ContactGeometry::surface_towards`], also for a hull with known faces. `None` for a point of
    /// a hull that is not above any face.
    pub(super) fn surface_towards(
        &self,
        point: &Vector3<f64>,
        reference: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        if self.faces.is_empty() {
            return self.shape.surface_towards(point, reference);
        }
        let height = |(normal, along): &(Vector3<f64>, f64)| normal.dot(point) - along;
        let highest = self.faces.iter().map(height).fold(f64::NEG_INFINITY, f64::max);
        let near = self.faces.iter().filter(|face| height(face) > highest - EDGE_BAND);
        let face = near.max_by(|a, b| a.0.dot(reference).total_cmp(&b.0.dot(reference)))?;
        let distance = height(face);
        let foot = point - face.0 * distance;
        let band = if highest < EDGE_BAND { EDGE_BAND } else { BESIDE };
        let over = self.faces.iter().all(|(normal, along)| normal.dot(&foot) - along < band);
        over.then_some((distance, face.0))
    }
}

/// The face planes of a collider: outward normals and heights along them.
pub(super) struct Faces<'a>(&'a [(Vector3<f64>, f64)]);

impl<'a> Faces<'a> {
    /// Returns the planes of a box, of a hull in a world with mesh triangles, or of a prism around a
    /// cylinder, turned towards the segment between `ends`. Other shapes have none.
    pub(super) fn from_collider(
        collider: &'a Collider,
        ends: &[Vector3<f64>; 2],
        room: &'a mut [(Vector3<f64>, f64); SIDES],
    ) -> Self {
        match &collider.shape {
            ConvexShape::Box { half } => {
                for axis in 0..3 {
                    let mut normal = Vector3::zeros();
                    normal[axis] = 1.0;
                    (room[2 * axis], room[2 * axis + 1]) = ((normal, half[axis]), (-normal, half[axis]));
                }
                Self(&room[..6])
            }
            ConvexShape::Cylinder { radius, half_length } => {
                let along = ends[1] - ends[0];
                let (across, level) = (along.xy(), ends[0].xy());
                let square = across.norm_squared();
                let at = if square > 0.0 { (-level.dot(&across) / square).clamp(0.0, 1.0) } else { 0.0 };
                let near = level + across * at;
                let start = if near.norm() > 1e-9 { near.y.atan2(near.x) } else { 0.0 };
                for (side, plane) in room.iter_mut().take(8).enumerate() {
                    let (sin, cos) = (start + core::f64::consts::FRAC_PI_4 * side as f64).sin_cos();
                    *plane = (Vector3::new(cos, sin, 0.0), *radius);
                }
                room[8] = (Vector3::z(), *half_length);
                room[9] = (-Vector3::z(), *half_length);
                Self(&room[..])
            }
            _ => Self(&collider.sides),
        }
    }

    pub(super) fn planes(&self) -> &[(Vector3<f64>, f64)] {
        self.0
    }

    /// Returns the part of a segment behind all faces but one, as fractions of its length.
    pub(super) fn clip(&self, ends: &[Vector3<f64>; 2], but: usize) -> Option<[f64; 2]> {
        let mut part = [0.0_f64, 1.0_f64];
        for (_, (normal, height)) in self.0.iter().enumerate().filter(|(face, _)| *face != but) {
            let [from, to] = [0, 1].map(|end| normal.dot(&ends[end]) - height);
            match (from > 0.0, to > 0.0) {
                (true, true) => return None,
                (true, false) => part[0] = part[0].max(from / (from - to)),
                (false, true) => part[1] = part[1].min(from / (from - to)),
                (false, false) => {}
            }
        }
        (part[0] <= part[1]).then_some(part)
    }
}
