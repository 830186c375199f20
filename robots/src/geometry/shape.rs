//! Convex shapes for physics engines.

use nalgebra::Vector3;
use parry3d_f64::transformation::try_convex_hull;

use crate::math::{V3, v3, vector};

/// Tolerance of equal plane normals.
const SAME: f64 = 1e-9;

/// A convex shape centred on the origin of its frame. Lengths are in metres, and axes of revolution are along
/// z.
///
/// # Example
///
/// ```
/// use std::path::Path;
/// use motorium_robots::{CollisionModel, CollisionOptions, ConvexShape, load};
///
/// let panda = load("panda", Path::new("."))?;
/// let solids = CollisionModel::new(&panda.model, &CollisionOptions::default())?;
/// let cylinders = (0..solids.solid_count())
///     .filter(|&solid| matches!(solids.convex_shape(solid), ConvexShape::Cylinder { .. }))
///     .count();
/// assert!(cylinders > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum ConvexShape {
    /// A sphere.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// A box.
    Box {
        /// Half sides along x, y and z \[m\].
        half: Vector3<f64>,
    },
    /// A cylinder.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Half the length of the cylinder \[m\].
        half_length: f64,
    },
    /// All points within `radius` of a segment.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Half the length of the segment \[m\].
        half_length: f64,
    },
    /// The convex hull of points.
    Hull {
        /// The points \[m\].
        points: Vec<Vector3<f64>>,
    },
    /// All points with z <= 0.
    HalfSpace,
}

impl ConvexShape {
    /// Returns the radius of the smallest sphere about the origin that contains the shape \[m\]; infinite for
    /// a half-space.
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Sphere { radius } => *radius,
            Self::Box { half } => half.norm(),
            Self::Cylinder { radius, half_length } => radius.hypot(*half_length),
            Self::Capsule { radius, half_length } => radius + half_length,
            Self::Hull { points } => points.iter().map(|point| point.norm()).fold(0.0, f64::max),
            Self::HalfSpace => f64::INFINITY,
        }
    }

    /// Returns the planes of the faces of a hull, each as an outward normal and an offset \[m\]. Empty for
    /// shapes that are not hulls, and for hulls without volume.
    pub fn faces(&self) -> Vec<(Vector3<f64>, f64)> {
        let Self::Hull { points } = self else { return Vec::new() };
        let planes = planes(points).unwrap_or_default();
        planes.into_iter().map(|(normal, height)| (normal.into(), height)).collect()
    }
}

/// Returns the planes of the faces of a convex hull, each once; `None` without volume.
pub(crate) fn planes(points: &[Vector3<f64>]) -> Option<Vec<(V3, f64)>> {
    let points: Vec<_> = points.iter().map(|&point| vector(point.into())).collect();
    let (corners, triangles) = try_convex_hull(&points).ok()?;
    let corners: Vec<V3> = corners.into_iter().map(v3).collect();
    let mut planes: Vec<(V3, f64)> = Vec::new();
    for [a, b, c] in triangles {
        let [a, b, c] = [a, b, c].map(|index| corners[index as usize]);
        let normal = (b - a).cross(c - a);
        let length = normal.dot(normal).sqrt();
        if length < 1e-18 {
            continue;
        }
        let normal = normal * (1.0 / length);
        // the offset uses the outermost corner, so that rounding leaves no corner outside
        let height = corners.iter().map(|corner| normal.dot(*corner)).fold(f64::NEG_INFINITY, f64::max);
        let known = |(other, at): &(V3, f64)| 1.0 - normal.dot(*other) < SAME && (height - at).abs() < SAME;
        if !planes.iter().any(known) {
            planes.push((normal, height));
        }
    }
    (planes.len() > 3).then_some(planes)
}

/// Returns the points that are outermost towards the faces, edges and corners of a cube: at most 26.
pub(super) fn outermost(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut chosen: Vec<usize> = Vec::new();
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                let direction = Vector3::new(x, y, z);
                if direction == Vector3::zeros() {
                    continue;
                }
                let height = |index: &usize| points[*index].dot(&direction);
                let best = (0..points.len()).max_by(|a, b| height(a).total_cmp(&height(b)));
                if let Some(best) = best.filter(|best| !chosen.contains(best)) {
                    chosen.push(best);
                }
            }
        }
    }
    chosen.into_iter().map(|index| points[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extreme_points_of_a_box_are_its_corners() {
        let mut points = vec![Vector3::zeros(), Vector3::new(0.05, 0.0, 0.0)];
        for corner in 0..8_u32 {
            let sign = |bit: u32| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
            points.push(Vector3::new(0.2 * sign(0), 0.3 * sign(1), 0.1 * sign(2)));
        }
        let kept = outermost(&points);
        for corner in &points[2..] {
            assert!(kept.contains(corner), "{corner}");
        }
        assert_eq!(kept.len(), 8);
    }
}
