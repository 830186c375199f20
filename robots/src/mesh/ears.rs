//! Triangulation of polygons by ear clipping, which also handles concave polygons. A fan of triangles would
//! cover their notches.

use nalgebra::{Vector2, Vector3};

/// Writes the triangles of the polygon with these corners and keeps its orientation. A convex polygon becomes
/// a fan from its first corner. A self-intersecting polygon has no well-defined interior: once no ear
/// remains, the rest becomes a fan.
pub(super) fn triangulate(points: &[Vector3<f64>], corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    let fan = |corners: &[u32], triangles: &mut Vec<[u32; 3]>| {
        if let [first, others @ ..] = corners {
            triangles.extend(others.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    };
    let Some(flat) = project(points, corners) else { return fan(corners, triangles) };
    let count = corners.len();
    let turn = |i: usize| cross(&flat[(i + count - 1) % count], &flat[i], &flat[(i + 1) % count]);
    if (0..count).all(|i| turn(i) >= 0.0) {
        return fan(corners, triangles);
    }
    let mut left: Vec<usize> = (0..count).collect();
    while left.len() > 3 {
        let Some(ear) = (0..left.len()).find(|place| is_ear(&flat, &left, *place)) else { break };
        let (before, after) = neighbours(&left, ear);
        triangles.push([before, left[ear], after].map(|corner| corners[corner]));
        left.remove(ear);
    }
    let rest: Vec<u32> = left.iter().map(|corner| corners[*corner]).collect();
    fan(&rest, triangles);
}

/// Projects the corners into the plane of the polygon, counter-clockwise; `None` for a polygon without an
/// area.
fn project(points: &[Vector3<f64>], corners: &[u32]) -> Option<Vec<Vector2<f64>>> {
    let point = |place: usize| points[corners[place % corners.len()] as usize];
    // Newell's normal: exact for planar polygons of any shape
    let origin = point(0);
    let normal: Vector3<f64> =
        (0..corners.len()).map(|i| (point(i) - origin).cross(&(point(i + 1) - origin))).sum();
    let normal = normal.try_normalize(0.0)?;
    let side = Vector3::ith(normal.iamin(), 1.0).cross(&normal).try_normalize(0.0)?;
    let up = normal.cross(&side);
    let flat = |place| Vector2::new(side.dot(&(point(place) - origin)), up.dot(&(point(place) - origin)));
    Some((0..corners.len()).map(flat).collect())
}

/// Returns twice the area of a triangle, positive if it is counter-clockwise.
fn cross(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - b))
}

fn neighbours(left: &[usize], place: usize) -> (usize, usize) {
    (left[(place + left.len() - 1) % left.len()], left[(place + 1) % left.len()])
}

/// Returns `true` if the triangle at a corner is inside the polygon: the corner is convex and no other corner
/// is in the triangle.
fn is_ear(flat: &[Vector2<f64>], left: &[usize], place: usize) -> bool {
    let (before, after) = neighbours(left, place);
    let [a, b, c] = [before, left[place], after].map(|corner| flat[corner]);
    let area = cross(&a, &b, &c);
    if area <= 0.0 {
        return false;
    }
    left.iter().filter(|corner| ![before, left[place], after].contains(corner)).all(|&corner| {
        let p = flat[corner];
        // corners that coincide with a corner of the triangle, as at the bridge to a hole, do not block it
        let is_corner = [a, b, c].contains(&p);
        is_corner || [(a, b), (b, c), (c, a)].iter().any(|(from, to)| cross(from, to, &p) < 0.0)
    })
}
