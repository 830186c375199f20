//! Convex polygons in the plane.

use nalgebra::Vector2;

/// Computes the corners of the convex hull of points in a plane. The result is written to `corners`,
/// counter-clockwise. It has two corners for collinear points, and one corner for a single point. `at`
/// projects a point into the plane, and `points` are sorted in place. Nothing allocates if `corners` has
/// capacity for twice the number of points plus two. (Andrew, *Another efficient algorithm for convex hulls
/// in two dimensions*, 1979.)
///
/// ```
/// use motorium_robots::convex_corners;
/// use nalgebra::Vector2;
///
/// let mut points = [(0.1, 0.1), (-0.1, 0.1), (0.0, 0.0), (-0.1, -0.1), (0.1, -0.1)].map(|(x, y)| Vector2::new(x, y));
/// let mut corners = Vec::new();
/// convex_corners(&mut points, |point| *point, &mut corners);
/// assert_eq!(corners.len(), 4, "the point in the middle is no corner");
/// ```
pub fn convex_corners<P: Copy>(points: &mut [P], at: impl Fn(&P) -> Vector2<f64>, corners: &mut Vec<P>) {
    points.sort_unstable_by(|a, b| {
        let (a, b) = (at(a), at(b));
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
    });
    corners.clear();
    // the lower chain, then the upper one
    let grow = |point: P, first: usize, corners: &mut Vec<P>| {
        while let [.., a, b] = corners[first..] {
            if (at(&b) - at(&a)).perp(&(at(&point) - at(&a))) > 0.0 {
                break;
            }
            corners.pop();
        }
        corners.push(point);
    };
    for point in &*points {
        grow(*point, 0, corners);
    }
    let first = corners.len().saturating_sub(1);
    for point in points.iter().rev().skip(1) {
        grow(*point, first, corners);
    }
    if points.len() > 1 {
        corners.pop();
    }
}

/// Removes the part of a convex polygon to the right of the edge from `a` to `b` (Sutherland and Hodgman
/// 1974).
pub(super) fn clip(
    corners: &[Vector2<f64>],
    [a, b]: [Vector2<f64>; 2],
    rounding: f64,
    kept: &mut Vec<Vector2<f64>>,
) {
    kept.clear();
    let side = |point: &Vector2<f64>| (b - a).perp(&(point - a));
    for (corner, next) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (here, there) = (side(corner), side(next));
        if here >= -rounding {
            kept.push(*corner);
        }
        if (here > rounding && there < -rounding) || (here < -rounding && there > rounding) {
            kept.push(corner + (next - corner) * (here / (here - there)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_point_sets_have_minimal_hulls() {
        let corners_of = |points: &[(f64, f64)]| {
            let mut points: Vec<_> = points.iter().map(|(x, y)| Vector2::new(*x, *y)).collect();
            let mut corners = Vec::new();
            convex_corners(&mut points, |point| *point, &mut corners);
            corners.len()
        };
        assert_eq!(corners_of(&[]), 0);
        assert_eq!(corners_of(&[(1.0, 2.0)]), 1);
        assert_eq!(corners_of(&[(1.0, 2.0), (0.0, 0.0)]), 2);
        assert_eq!(corners_of(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]), 2);
        assert_eq!(corners_of(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.2, 0.2)]), 3);
    }

    #[test]
    fn clipped_square_has_five_corners() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vector2::new(x, y));
        let mut kept = Vec::new();
        clip(&square, [Vector2::new(1.0, 0.5), Vector2::new(0.5, 1.0)], 1e-15, &mut kept);
        let area: f64 = kept.iter().zip(kept.iter().cycle().skip(1)).map(|(a, b)| 0.5 * a.perp(b)).sum();
        assert_eq!(kept.len(), 5);
        assert!((area - 0.875).abs() < 1e-15, "{area}");
    }
}
