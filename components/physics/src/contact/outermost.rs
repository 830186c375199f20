//! Dense hulls: the few corners by which they touch.

use nalgebra::Vector3;

use super::axes::axes;

/// Hulls with more corners than this touch by a subset of them.
pub(super) const DENSE: usize = 64;

/// Corners within these fractions of the hull's size of the outermost corner count as in the same plane, or
/// as near it.
const FLAT: f64 = 1e-4;
const NEAR: f64 = 0.02;

/// Finds the outermost corners of a hull in the direction `up` (a unit vector): the outermost one first, then
/// the corners within `depth` \[m\] of it that are farthest in `N - 1` directions perpendicular to `up`.
/// Returns their number.
fn outermost<const N: usize>(
    points: &[Vector3<f64>],
    up: &Vector3<f64>,
    depth: f64,
    chosen: &mut [u32; N],
) -> usize {
    let mut first = 0;
    let mut highest = f64::NEG_INFINITY;
    for (index, point) in points.iter().enumerate() {
        let height = point.dot(up);
        if height > highest {
            (first, highest) = (index, height);
        }
    }
    let [_, one, other] = axes(up);
    let mut best = [(f64::NEG_INFINITY, first as u32); N];
    for (index, point) in points.iter().enumerate().filter(|(_, point)| point.dot(up) > highest - depth) {
        let (x, y) = (point.dot(&one), point.dot(&other));
        for (direction, best) in best.iter_mut().enumerate().skip(1) {
            let (sin, cos) = (core::f64::consts::TAU * direction as f64 / (N - 1) as f64).sin_cos();
            let along = x * cos + y * sin;
            // Rounding must not decide between two corners.
            if along > best.0 + 1e-9 {
                *best = (along, index as u32);
            }
        }
    }
    let mut count = 0;
    for (_, index) in best {
        if !chosen[..count].contains(&index) {
            chosen[count] = index;
            count += 1;
        }
    }
    count
}

/// Returns the corners of the outermost face of a dense hull in the direction `up`, at most `N`.
pub(super) fn outermost_face<const N: usize>(
    points: &[Vector3<f64>],
    up: &Vector3<f64>,
    size: f64,
    chosen: &mut [u32; N],
) -> usize {
    outermost(points, up, FLAT * size, chosen)
}

/// Passes the corners with which a dense hull touches a plane in the direction `up` to `visit`: the corners
/// of its outermost face, and of faces that may soon be outermost.
pub(super) fn touching(points: &[Vector3<f64>], up: &Vector3<f64>, size: f64, visit: &mut dyn FnMut(u32)) {
    let (mut face, mut near) = ([0; 9], [0; 5]);
    let count = outermost(points, up, FLAT * size, &mut face);
    face[..count].iter().for_each(|index| visit(*index));
    let more = outermost(points, up, NEAR * size, &mut near);
    near[..more].iter().filter(|index| !face[..count].contains(index)).for_each(|index| visit(*index));
}
