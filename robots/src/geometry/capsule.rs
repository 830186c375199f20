//! Capsules around points: substitutes for meshes that are a hundred times faster to query.

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Translation3, Unit, Vector3};

use crate::Geometry;
use crate::math::lie::so3;

/// Step sizes of the search for the best axis: from 0.3 rad, halved whenever no direction improves, to below
/// a milliradian.
const WIDEST: f64 = 0.3;
const FINEST: f64 = 1e-3;
const MOST_STEPS: usize = 60;

/// Fits a tight capsule around `points`. Returns the pose of the capsule, whose axis is along z, and its
/// [`Geometry::Capsule`]. Returns `None` if `points` is empty.
///
/// A local search from each principal axis of the points finds the axis with the minimum volume. The radius
/// of the capsule is the radius of the smallest circle around the points projected along this axis.
pub fn fit_capsule(points: &[Vector3<f64>]) -> Option<(Isometry3<f64>, Geometry)> {
    if points.is_empty() {
        return None;
    }
    // In shuffled order, for which the smallest-circle search is linear (Welzl 1991).
    let mut points = points.to_vec();
    let mut seed = 1_u64;
    for last in (1..points.len()).rev() {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        points.swap(last, (seed >> 33) as usize % (last + 1));
    }
    let points = &*points;
    let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|point| (point - mean) * (point - mean).transpose()).sum();
    let starts = SymmetricEigen::new(spread).eigenvectors;
    let best = starts
        .column_iter()
        .map(|axis| improve(points, Unit::new_normalize(axis.into_owned())))
        .filter(|fit| fit.volume().is_finite())
        .min_by(|a, b| a.volume().total_cmp(&b.volume()))?;
    let turn = so3::least_rotation(&Vector3::z_axis(), &best.axis);
    let placement = Isometry3::from_parts(Translation3::from(best.middle), turn);
    Some((placement, Geometry::Capsule { radius: best.radius, length: best.length }))
}

#[derive(Clone, Copy)]
struct Fit {
    axis: Unit<Vector3<f64>>,
    middle: Vector3<f64>,
    radius: f64,
    length: f64,
}

impl Fit {
    fn volume(&self) -> f64 {
        std::f64::consts::PI * self.radius.powi(2) * (self.length + 4.0 / 3.0 * self.radius)
    }

    /// Returns the smallest capsule along `axis`.
    fn along(points: &[Vector3<f64>], axis: Unit<Vector3<f64>>) -> Self {
        let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
        let other = axis.cross(&across);
        let seen: Vec<_> = points.iter().map(|point| [point.dot(&across), point.dot(&other)]).collect();
        let (centre, _) = smallest_circle(&seen);
        // The circle is accurate to rounding; the radius must contain every point.
        let radius = seen.iter().map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1])).fold(0.0, f64::max);
        // Limits of the cap positions such that each point is inside.
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (point, seen) in points.iter().zip(&seen) {
            let off = (seen[0] - centre[0]).powi(2) + (seen[1] - centre[1]).powi(2);
            let reach = (radius * radius - off).max(0.0).sqrt();
            let at = point.dot(&axis);
            low = low.min(at + reach);
            high = high.max(at - reach);
        }
        let (length, half) = ((high - low).max(0.0), 0.5 * (high + low));
        let middle = across * centre[0] + other * centre[1] + axis.into_inner() * half;
        Self { axis, middle, radius, length }
    }
}

/// Tilts the axis until the volume no longer decreases.
fn improve(points: &[Vector3<f64>], axis: Unit<Vector3<f64>>) -> Fit {
    let mut best = Fit::along(points, axis);
    let mut step = WIDEST;
    // Collinear points have volumes of rounding noise, which could decrease for a long time.
    for _ in 0..MOST_STEPS {
        if step < FINEST {
            break;
        }
        let across = best.axis.cross(&Vector3::ith(best.axis.iamin(), 1.0)).normalize();
        let other = best.axis.cross(&across);
        let tilts = [across, -across, other, -other];
        let tried =
            tilts.map(|tilt| Fit::along(points, Unit::new_normalize(best.axis.into_inner() + tilt * step)));
        match tried.into_iter().min_by(|a, b| a.volume().total_cmp(&b.volume())) {
            Some(better) if better.volume() < best.volume() * (1.0 - 1e-9) => best = better,
            _ => step *= 0.5,
        }
    }
    best
}

/// Returns centre and radius of the smallest circle around points (Welzl 1991, in the iterative form).
fn smallest_circle(points: &[[f64; 2]]) -> ([f64; 2], f64) {
    let mut circle = ([0.0; 2], -1.0);
    for (i, &p) in points.iter().enumerate() {
        if outside(&circle, p) {
            circle = (p, 0.0);
            for (j, &q) in points[..i].iter().enumerate() {
                if outside(&circle, q) {
                    circle = around(p, q);
                    for &r in &points[..j] {
                        if outside(&circle, r) {
                            circle = through(p, q, r);
                        }
                    }
                }
            }
        }
    }
    circle
}

fn outside((centre, radius): &([f64; 2], f64), p: [f64; 2]) -> bool {
    (p[0] - centre[0]).hypot(p[1] - centre[1]) > radius * (1.0 + 1e-9) + 1e-300
}

fn around(p: [f64; 2], q: [f64; 2]) -> ([f64; 2], f64) {
    let centre = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    (centre, 0.5 * (p[0] - q[0]).hypot(p[1] - q[1]))
}

fn through(p: [f64; 2], q: [f64; 2], r: [f64; 2]) -> ([f64; 2], f64) {
    let (bx, by, cx, cy) = (q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]);
    let double = 2.0 * (bx * cy - by * cx);
    if double == 0.0 {
        // Collinear: the circle around the two points farthest apart.
        let pairs = [around(p, q), around(p, r), around(q, r)];
        return pairs.into_iter().fold(pairs[0], |a, b| if b.1 > a.1 { b } else { a });
    }
    let (b, c) = (bx * bx + by * by, cx * cx + cy * cy);
    let (ux, uy) = ((cy * b - by * c) / double, (bx * c - cx * b) / double);
    ([p[0] + ux, p[1] + uy], ux.hypot(uy))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// Returns `true` if `point` is inside a placed capsule, within `slack`.
    fn holds(placement: &Isometry3<f64>, geometry: &Geometry, point: &Vector3<f64>, slack: f64) -> bool {
        let &Geometry::Capsule { radius, length } = geometry else { return false };
        let local = placement.inverse_transform_point(&Point3::from(*point));
        let z = local.z - local.z.clamp(-0.5 * length, 0.5 * length);
        Vector3::new(local.x, local.y, z).norm() <= radius + slack
    }

    /// Returns points on the surface of a capsule, by two angles and a height.
    fn surface(placement: &Isometry3<f64>, radius: f64, length: f64) -> Vec<Vector3<f64>> {
        let mut points = Vec::new();
        for turn in 0..24 {
            let a = f64::from(turn) / 24.0 * std::f64::consts::TAU;
            for tilt in 0..=12 {
                let b = (f64::from(tilt) / 12.0 - 0.5) * std::f64::consts::PI;
                let end = 0.5 * length * b.signum();
                let local = Point3::new(
                    radius * b.cos() * a.cos(),
                    radius * b.cos() * a.sin(),
                    radius * b.sin() + end,
                );
                points.push((placement * local).coords);
            }
        }
        points
    }

    #[test]
    fn capsule_is_recovered_from_its_surface_points() {
        let placement = Isometry3::new(Vector3::new(0.3, -0.2, 0.9), Vector3::new(0.4, 1.1, -0.3));
        let points = surface(&placement, 0.06, 0.4);
        let (found, geometry) = fit_capsule(&points).unwrap();
        let Geometry::Capsule { radius, length } = geometry else { panic!("{geometry:?}") };
        assert!((radius - 0.06).abs() < 1e-3 && (length - 0.4).abs() < 5e-3, "{radius} {length}");
        assert!((found.translation.vector - placement.translation.vector).norm() < 2e-3);
        assert!((found * Vector3::z()).dot(&(placement * Vector3::z())).abs() > 0.9999);
    }

    #[test]
    fn capsule_contains_every_point_tightly() {
        let mut seed = 7_u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for _ in 0..20 {
            let points: Vec<_> =
                (0..60).map(|_| Vector3::new(random() * 0.7, random() * 0.2, random() * 0.1)).collect();
            let (placement, geometry) = fit_capsule(&points).unwrap();
            assert!(points.iter().all(|point| holds(&placement, &geometry, point, 1e-9)));
            let Geometry::Capsule { radius, length } = geometry else { panic!("{geometry:?}") };
            // The box around them has a diagonal of 0.73 m and a cross-section of 0.22 m.
            assert!(length + 2.0 * radius < 0.85 && radius < 0.12, "{radius} {length}");
        }
    }

    #[test]
    fn degenerate_points_have_a_capsule() {
        let one = [Vector3::new(1.0, 2.0, 3.0)];
        let (placement, geometry) = fit_capsule(&one).unwrap();
        assert!(holds(&placement, &geometry, &one[0], 1e-12));
        let line = [Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0), Vector3::new(3.0, 0.0, 0.0)];
        let (placement, geometry) = fit_capsule(&line).unwrap();
        assert!(line.iter().all(|point| holds(&placement, &geometry, point, 1e-9)), "{geometry:?}");
        assert!(fit_capsule(&[]).is_none());
    }
}
