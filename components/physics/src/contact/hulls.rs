//! Faces of convex colliders, in contact with points and edges of other colliders.

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
    /// Returns the outward normal of the face that an outside point is farthest in front of.
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
pub(super) struct Faces<'a> {
    planes: &'a [(Vector3<f64>, f64)],
    /// Radius of a cylinder \[m\], whose last two planes are its ends.
    radius: Option<f64>,
}

impl<'a> Faces<'a> {
    /// Returns the planes of a box, of a hull in a world with mesh triangles, or of a prism around a
    /// cylinder. The prism is turned towards the segment between `ends`. Other shapes have none.
    pub(super) fn from_collider(
        collider: &'a Collider,
        ends: &[Vector3<f64>; 2],
        room: &'a mut [(Vector3<f64>, f64); SIDES],
    ) -> Self {
        let mut round = None;
        let planes = match &collider.shape {
            ConvexShape::Box { half } => {
                for axis in 0..3 {
                    let mut normal = Vector3::zeros();
                    normal[axis] = 1.0;
                    (room[2 * axis], room[2 * axis + 1]) = ((normal, half[axis]), (-normal, half[axis]));
                }
                &room[..6]
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
                // The rim has its exact direction where the segment crosses it.
                let crossed = within_circle(ends, *radius).unwrap_or([f64::INFINITY; 2]);
                for (side, at) in [3, 5].into_iter().zip(crossed) {
                    if (0.0..=1.0).contains(&at) {
                        let out = ends[0].xy() + along.xy() * at;
                        room[side].0 = Vector3::new(out.x, out.y, 0.0) / *radius;
                    }
                }
                room[8] = (Vector3::z(), *half_length);
                room[9] = (-Vector3::z(), *half_length);
                round = Some(*radius);
                &room[..]
            }
            _ => &collider.sides[..],
        };
        Self { planes, radius: round }
    }

    pub(super) fn planes(&self) -> &[(Vector3<f64>, f64)] {
        self.planes
    }

    /// Returns the part of a segment behind all faces but one, as fractions of its length.
    pub(super) fn clip(&self, ends: &[Vector3<f64>; 2], but: usize) -> Option<[f64; 2]> {
        let mut part = [0.0_f64, 1.0_f64];
        let mut first = 0;
        // The end of a cylinder is round.
        if let Some(radius) = self.radius.filter(|_| but + 2 >= self.planes.len()) {
            let inside = within_circle(ends, radius)?;
            part = [inside[0].max(0.0), inside[1].min(1.0)];
            first = self.planes.len() - 2;
        }
        let others = self.planes.iter().enumerate().skip(first).filter(|(face, _)| *face != but);
        for (_, (normal, height)) in others {
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

/// Returns the part of the line through `ends` inside a cylinder of this radius around z, as fractions of the
/// distance between both ends.
fn within_circle(ends: &[Vector3<f64>; 2], radius: f64) -> Option<[f64; 2]> {
    let (start, across) = (ends[0].xy(), (ends[1] - ends[0]).xy());
    let (square, along) = (across.norm_squared(), start.dot(&across));
    let beyond = start.norm_squared() - radius * radius;
    if square < 1e-24 {
        return (beyond <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let root = along * along - square * beyond;
    (root >= 0.0).then(|| [-1.0, 1.0].map(|sign: f64| (sign * root.sqrt() - along) / square))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chord_of_a_circle_is_exact() {
        let chord = |y: f64| within_circle(&[Vector3::new(-2.0, y, 0.0), Vector3::new(2.0, y, 1.0)], 1.0);
        for y in [0.0_f64, 0.6, -0.8, 1.0] {
            let half = 0.25 * (1.0 - y * y).sqrt();
            let [from, to] = chord(y).unwrap();
            assert!((from - (0.5 - half)).abs() < 1e-12 && (to - (0.5 + half)).abs() < 1e-12, "{y}");
        }
        assert_eq!(chord(1.1), None);
    }
}
