//! Surfaces of convex shapes, and the points of a shape that touch other shapes first.

use motorium_robots::ConvexShape;
use nalgebra::{Unit, Vector3};

use super::outermost::{self, DENSE};

/// A point of a shape that may touch; the surface is at `radius` around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Feature {
    /// Feature number, which is stable for the same part of the shape.
    pub(crate) index: u32,
    pub(crate) point: Vector3<f64>,
    pub(crate) radius: f64,
}

/// A point closer than this to an edge of a box may belong to either face \[m\].
const EDGE_BAND: f64 = 1e-3;

/// The contact geometry of a convex shape.
pub(crate) trait ContactGeometry {
    /// Returns the signed distance of `point` from the surface \[m\], negative inside, and the outward normal
    /// there. `None` for a hull.
    fn surface(&self, point: &Vector3<f64>) -> Option<(f64, Vector3<f64>)>;

    /// Returns [`surface`](Self::surface) for a point of a body in the direction `reference` (a unit vector,
    /// outward). Within a millimetre of the edge of a box, `reference` decides which face the point touches:
    /// the lower edges of two boxes on the same ground meet exactly, and rounding must not decide.
    fn surface_towards(&self, point: &Vector3<f64>, reference: &Vector3<f64>) -> Option<(f64, Vector3<f64>)>;

    /// Returns `true` if the [features](Self::features) depend on the direction.
    fn turns_features(&self) -> bool;

    /// Passes the points that may touch a body in the direction `towards` (a unit vector) to `visit`.
    fn features(&self, towards: &Vector3<f64>, visit: &mut dyn FnMut(Feature));
}

impl ContactGeometry for ConvexShape {
    fn surface(&self, point: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        Some(match self {
            Self::Sphere { radius } => from_core(point, &Vector3::zeros(), *radius),
            Self::Capsule { radius, half_length: half } => {
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
            Self::Cylinder { radius, half_length: half } => {
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

    fn surface_towards(&self, point: &Vector3<f64>, reference: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        if let Self::Box { half } = self {
            let beyond = point.abs() - half;
            if beyond.sup(&Vector3::zeros()).norm() < EDGE_BAND {
                let outward = |axis: usize| reference[axis] * point[axis].signum();
                let near = (0..3).filter(|axis| beyond[*axis] > beyond.max() - EDGE_BAND);
                let face = near.max_by(|a, b| outward(*a).total_cmp(&outward(*b))).unwrap_or(beyond.imax());
                let mut normal = Vector3::zeros();
                normal[face] = point[face].signum();
                return Some((beyond[face], normal));
            }
        }
        self.surface(point)
    }

    fn turns_features(&self) -> bool {
        match self {
            Self::Cylinder { .. } => true,
            Self::Hull { points } => points.len() > DENSE,
            _ => false,
        }
    }

    fn features(&self, towards: &Vector3<f64>, visit: &mut dyn FnMut(Feature)) {
        match self {
            Self::Sphere { radius } => {
                visit(Feature { index: 0, point: Vector3::zeros(), radius: *radius });
            }
            Self::Capsule { radius, half_length: half } => {
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
            Self::Cylinder { radius, half_length: half } => {
                // The outermost point of each rim, and three more around it to support a standing cylinder.
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
            Self::Hull { points } if points.len() > DENSE => {
                outermost::touching(points, towards, self.bounding_radius(), &mut |index| {
                    visit(Feature { index, point: points[index as usize], radius: 0.0 });
                });
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

/// Returns distance and normal of a sphere of `radius` around `core`.
fn from_core(point: &Vector3<f64>, core: &Vector3<f64>, radius: f64) -> (f64, Vector3<f64>) {
    let away = point - core;
    let distance = away.norm();
    let normal = if distance > 1e-12 { away / distance } else { Vector3::z() };
    (distance - radius, normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<ConvexShape> {
        vec![
            ConvexShape::Sphere { radius: 0.3 },
            ConvexShape::Box { half: Vector3::new(0.2, 0.3, 0.1) },
            ConvexShape::Cylinder { radius: 0.2, half_length: 0.25 },
            ConvexShape::Capsule { radius: 0.15, half_length: 0.2 },
            ConvexShape::HalfSpace,
        ]
    }

    #[test]
    fn the_normal_is_the_slope_of_the_distance() {
        for shape in shapes() {
            for i in 0..60 {
                let phase = f64::from(i);
                let point = Vector3::new((1.3 * phase).sin(), (2.1 * phase).cos(), (0.7 * phase).sin()) * 0.4;
                let (_, normal) = shape.surface(&point).unwrap();
                for axis in 0..3 {
                    let mut step = Vector3::zeros();
                    step[axis] = 1e-6;
                    let ahead = shape.surface(&(point + step)).unwrap().0;
                    let behind = shape.surface(&(point - step)).unwrap().0;
                    assert!((normal[axis] - (ahead - behind) / 2e-6).abs() < 1e-4, "{shape:?} at {point}");
                }
            }
        }
    }

    #[test]
    fn reference_direction_decides_the_face_at_an_edge() {
        let shape = ConvexShape::Box { half: Vector3::new(0.2, 0.3, 0.1) };
        for slip in [-1e-10, 0.0, 1e-10] {
            let edge = Vector3::new(0.2 - 1e-9, 0.0, -0.1 + slip);
            let (distance, normal) = shape.surface_towards(&edge, &Vector3::x()).unwrap();
            assert_eq!(normal, Vector3::x());
            assert!((distance + 1e-9).abs() < 1e-15, "{distance}");
            assert_eq!(shape.surface_towards(&edge, &-Vector3::z()).unwrap().1, -Vector3::z());
        }
        // Away from edges `reference` has no effect, and deep inside the nearest face counts.
        for point in [Vector3::new(0.25, 0.0, 0.12), Vector3::new(0.1, 0.1, 0.09)] {
            assert_eq!(shape.surface_towards(&point, &Vector3::x()), shape.surface(&point));
        }
    }

    #[test]
    fn outermost_feature_matches_the_support_function() {
        for shape in shapes().into_iter().filter(|shape| *shape != ConvexShape::HalfSpace) {
            for i in 0..40 {
                let phase = f64::from(i);
                let towards =
                    Vector3::new((1.3 * phase).sin(), (2.1 * phase).cos(), (0.7 * phase).sin()).normalize();
                let mut out = f64::MIN;
                shape.features(&towards, &mut |f| out = out.max(f.point.dot(&towards) + f.radius));
                // The support function, computed from its definition for each shape.
                let across = towards.x.hypot(towards.y);
                let expected = match &shape {
                    ConvexShape::Sphere { radius } => *radius,
                    ConvexShape::Box { half } => half.dot(&towards.abs()),
                    ConvexShape::Cylinder { radius, half_length: half } => {
                        radius * across + half * towards.z.abs()
                    }
                    ConvexShape::Capsule { radius, half_length: half } => radius + half * towards.z.abs(),
                    _ => unreachable!(),
                };
                assert!((out - expected).abs() < 1e-12, "{shape:?} towards {towards}");
            }
        }
    }
}
