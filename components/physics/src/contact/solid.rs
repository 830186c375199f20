//! Convex solids: where their surface is, and with which points they touch others first.

use motorium_robots::{Geometry, MeshError, TriangleMesh};
use nalgebra::{Unit, Vector3};

use crate::ObjectShape;

/// A convex solid about the origin of its frame, z along its axis where it has one. Metres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Solid {
    /// A sphere.
    Sphere { radius: f64 },
    /// A box with these half sides.
    Box { half: Vector3<f64> },
    /// A cylinder of twice this height.
    Cylinder { radius: f64, half: f64 },
    /// All points within `radius` of a segment of twice this length.
    Capsule { radius: f64, half: f64 },
    /// The convex hull of these points. It touches with them, but is not touched by the points of others.
    Hull { points: Vec<Vector3<f64>> },
    /// All below the plane z = 0.
    HalfSpace,
}

/// A point with which a solid touches first: it stands out by `radius` all round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Feature {
    /// The same number for the same part of the solid.
    pub(crate) index: u32,
    pub(crate) point: Vector3<f64>,
    pub(crate) radius: f64,
}

/// A point nearer than this to an edge of a box may belong to either face \[m\].
const HAIR: f64 = 1e-3;

impl Solid {
    /// The solid of a link.
    ///
    /// # Errors
    ///
    /// [`MeshError`] when its mesh cannot be read; `None` inside when the mesh was not found.
    pub(crate) fn of_geometry(geometry: &Geometry) -> Result<Option<Self>, MeshError> {
        Ok(Some(match geometry {
            Geometry::Box { size } => Self::Box { half: 0.5 * size },
            Geometry::Cylinder { radius, length } => Self::Cylinder { radius: *radius, half: 0.5 * length },
            Geometry::Sphere { radius } => Self::Sphere { radius: *radius },
            Geometry::Capsule { radius, length } => Self::Capsule { radius: *radius, half: 0.5 * length },
            Geometry::Mesh { path: None, .. } => return Ok(None),
            Geometry::Mesh { path: Some(path), scale, .. } => {
                Self::Hull { points: outermost(&TriangleMesh::read(path)?.scaled(scale).points) }
            }
        }))
    }

    /// The solid of an object.
    pub(crate) fn of_object(shape: &ObjectShape) -> Self {
        match *shape {
            ObjectShape::Box { size } => Self::Box { half: 0.5 * Vector3::from(size) },
            ObjectShape::Sphere { radius } => Self::Sphere { radius },
            ObjectShape::Cylinder { radius, length } => Self::Cylinder { radius, half: 0.5 * length },
        }
    }

    /// Radius of the sphere about the origin that holds it.
    pub(crate) fn reach(&self) -> f64 {
        match self {
            Self::Sphere { radius } => *radius,
            Self::Box { half } => half.norm(),
            Self::Cylinder { radius, half } => radius.hypot(*half),
            Self::Capsule { radius, half } => radius + half,
            Self::Hull { points } => points.iter().map(|point| point.norm()).fold(0.0, f64::max),
            Self::HalfSpace => f64::INFINITY,
        }
    }

    /// Signed distance of `point` from the surface, negative inside, and the outward normal there. A hull has none.
    pub(crate) fn surface(&self, point: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        Some(match self {
            Self::Sphere { radius } => from_core(point, &Vector3::zeros(), *radius),
            Self::Capsule { radius, half } => {
                from_core(point, &Vector3::new(0.0, 0.0, point.z.clamp(-half, *half)), *radius)
            }
            Self::Box { half } => {
                let beyond = point.abs() - half;
                let outside = beyond.sup(&Vector3::zeros());
                if outside.norm_squared() > 0.0 {
                    let normal = outside.component_mul(&point.map(f64::signum));
                    (outside.norm(), normal / outside.norm())
                } else {
                    let face = beyond.imax();
                    let mut normal = Vector3::zeros();
                    normal[face] = point[face].signum();
                    (beyond[face], normal)
                }
            }
            Self::Cylinder { radius, half } => {
                let away = Vector3::new(point.x, point.y, 0.0);
                let side = Unit::try_new(away, 1e-12).unwrap_or(Vector3::x_axis()).into_inner();
                let end = Vector3::new(0.0, 0.0, point.z.signum());
                let (across, along) = (away.norm() - radius, point.z.abs() - half);
                if across > 0.0 && along > 0.0 {
                    let distance = across.hypot(along);
                    (distance, (side * across + end * along) / distance)
                } else if across > along {
                    (across, side)
                } else {
                    (along, end)
                }
            }
            Self::HalfSpace => (point.z, Vector3::z()),
            Self::Hull { .. } => return None,
        })
    }

    /// [`surface`](Self::surface) for a point of something that lies in the direction `reference` (a unit vector, outward).
    /// Where a point is within a hair of the edge of a box, that decides which face it touches: of two boxes on one ground
    /// the lower edges meet exactly, and rounding must not.
    pub(crate) fn surface_towards(
        &self,
        point: &Vector3<f64>,
        reference: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        if let Self::Box { half } = self {
            let beyond = point.abs() - half;
            if beyond.sup(&Vector3::zeros()).norm() < HAIR {
                let outward = |axis: usize| reference[axis] * point[axis].signum();
                let near = (0..3).filter(|axis| beyond[*axis] > beyond.max() - HAIR);
                let face = near.max_by(|a, b| outward(*a).total_cmp(&outward(*b))).unwrap_or(beyond.imax());
                let mut normal = Vector3::zeros();
                normal[face] = point[face].signum();
                return Some((beyond[face], normal));
            }
        }
        self.surface(point)
    }

    /// Shows the points with which it touches what lies in the direction `towards` (a unit vector).
    pub(crate) fn features(&self, towards: &Vector3<f64>, visit: &mut dyn FnMut(Feature)) {
        match self {
            Self::Sphere { radius } => {
                visit(Feature { index: 0, point: Vector3::zeros(), radius: *radius });
            }
            Self::Capsule { radius, half } => {
                for (index, z) in [-half, *half].into_iter().enumerate() {
                    visit(Feature { index: index as u32, point: Vector3::new(0.0, 0.0, z), radius: *radius });
                }
            }
            Self::Box { half } => {
                for index in 0..8_u32 {
                    let sign = |bit: u32| if index >> bit & 1 == 0 { -1.0 } else { 1.0 };
                    let point = half.component_mul(&Vector3::new(sign(0), sign(1), sign(2)));
                    visit(Feature { index, point, radius: 0.0 });
                }
            }
            Self::Cylinder { radius, half } => {
                // The outermost point of each rim, and three more around it that carry a standing cylinder.
                let out = Vector3::new(towards.x, towards.y, 0.0);
                let out = Unit::try_new(out, 1e-9).unwrap_or(Vector3::x_axis()).into_inner() * *radius;
                let round = Vector3::new(-out.y, out.x, 0.0);
                for (end, z) in [-half, *half].into_iter().enumerate() {
                    for (turn, rim) in [out, round, -out, -round].into_iter().enumerate() {
                        let point = Vector3::new(rim.x, rim.y, z);
                        visit(Feature { index: (4 * end + turn) as u32, point, radius: 0.0 });
                    }
                }
            }
            Self::Hull { points } => {
                for (index, point) in points.iter().enumerate() {
                    visit(Feature { index: index as u32, point: *point, radius: 0.0 });
                }
            }
            Self::HalfSpace => {}
        }
    }
}

/// Distance and normal of a surface that runs `radius` from the point `core`.
fn from_core(point: &Vector3<f64>, core: &Vector3<f64>, radius: f64) -> (f64, Vector3<f64>) {
    let away = point - core;
    let distance = away.norm();
    let normal = if distance > 1e-12 { away / distance } else { Vector3::z() };
    (distance - radius, normal)
}

/// The points of a mesh that are outermost towards a face, an edge or a corner of a cube: enough to stand and lie on.
fn outermost(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut chosen: Vec<usize> = Vec::new();
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                let direction = Vector3::new(x, y, z);
                if direction == Vector3::zeros() {
                    continue;
                }
                let out = |index: &usize| points[*index].dot(&direction);
                let best = (0..points.len()).max_by(|a, b| out(a).total_cmp(&out(b)));
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

    fn solids() -> Vec<Solid> {
        vec![
            Solid::Sphere { radius: 0.3 },
            Solid::Box { half: Vector3::new(0.2, 0.3, 0.1) },
            Solid::Cylinder { radius: 0.2, half: 0.25 },
            Solid::Capsule { radius: 0.15, half: 0.2 },
            Solid::HalfSpace,
        ]
    }

    #[test]
    fn the_normal_is_the_slope_of_the_distance() {
        for solid in solids() {
            for i in 0..60 {
                let phase = f64::from(i);
                let point = Vector3::new((1.3 * phase).sin(), (2.1 * phase).cos(), (0.7 * phase).sin()) * 0.4;
                let (_, normal) = solid.surface(&point).unwrap();
                for axis in 0..3 {
                    let mut step = Vector3::zeros();
                    step[axis] = 1e-6;
                    let ahead = solid.surface(&(point + step)).unwrap().0;
                    let behind = solid.surface(&(point - step)).unwrap().0;
                    assert!((normal[axis] - (ahead - behind) / 2e-6).abs() < 1e-4, "{solid:?} at {point}");
                }
            }
        }
    }

    #[test]
    fn at_an_edge_the_side_that_something_lies_on_decides() {
        let solid = Solid::Box { half: Vector3::new(0.2, 0.3, 0.1) };
        for slip in [-1e-10, 0.0, 1e-10] {
            let edge = Vector3::new(0.2 - 1e-9, 0.0, -0.1 + slip);
            let (distance, normal) = solid.surface_towards(&edge, &Vector3::x()).unwrap();
            assert_eq!(normal, Vector3::x());
            assert!((distance + 1e-9).abs() < 1e-15, "{distance}");
            assert_eq!(solid.surface_towards(&edge, &-Vector3::z()).unwrap().1, -Vector3::z());
        }
        // Away from edges nothing changes, and deep inside the nearest face counts.
        for point in [Vector3::new(0.25, 0.0, 0.12), Vector3::new(0.1, 0.1, 0.09)] {
            assert_eq!(solid.surface_towards(&point, &Vector3::x()), solid.surface(&point));
        }
    }

    #[test]
    fn the_outermost_feature_is_as_far_out_as_the_solid() {
        for solid in solids().into_iter().filter(|solid| *solid != Solid::HalfSpace) {
            for i in 0..40 {
                let phase = f64::from(i);
                let towards =
                    Vector3::new((1.3 * phase).sin(), (2.1 * phase).cos(), (0.7 * phase).sin()).normalize();
                let mut out = f64::MIN;
                solid.features(&towards, &mut |f| out = out.max(f.point.dot(&towards) + f.radius));
                // The support function, by its definition for each of them.
                let across = towards.x.hypot(towards.y);
                let expected = match &solid {
                    Solid::Sphere { radius } => *radius,
                    Solid::Box { half } => half.dot(&towards.abs()),
                    Solid::Cylinder { radius, half } => radius * across + half * towards.z.abs(),
                    Solid::Capsule { radius, half } => radius + half * towards.z.abs(),
                    _ => unreachable!(),
                };
                assert!((out - expected).abs() < 1e-12, "{solid:?} towards {towards}");
            }
        }
    }

    #[test]
    fn a_mesh_keeps_the_points_it_stands_on() {
        let half = Vector3::new(0.2, 0.3, 0.1);
        let mut points = vec![Vector3::zeros(), Vector3::new(0.05, 0.0, 0.0)];
        Solid::Box { half }.features(&Vector3::z(), &mut |feature| points.push(feature.point));
        let kept = outermost(&points);
        for corner in &points[2..] {
            assert!(kept.contains(corner), "{corner}");
        }
        assert_eq!(kept.len(), 8);
    }
}
