//! Triangle surfaces for contacts and rays.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::tree::{Bounds, BoxTree, is_met, least, most, overlap};
use crate::TriangleMesh;
use crate::math::V3;

/// A triangle of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTriangle {
    /// Corners \[m\], counter-clockwise as seen from outside.
    pub corners: [Point3<f64>; 3],
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    /// Depth \[m\] of the valley at each side of the triangle: the height by which the neighbouring triangle
    /// rises above this triangle's plane; 0 if the neighbour does not rise. The first side runs from the
    /// first to the second corner.
    pub valley: [f64; 3],
}

/// A convex edge of a surface: a ridge between two triangles, or the rim of an open surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceEdge {
    /// Ends \[m\].
    pub ends: [Point3<f64>; 2],
    /// Outward unit normals of both adjacent triangles. At a rim, which has only one adjacent triangle, the
    /// first vector is the normal of this triangle. The second vector is in the triangle's plane and points
    /// away from the triangle.
    pub normals: [Vector3<f64>; 2],
}

/// Surface of a mesh, for contacts and rays. The front side of its triangles is outside.
///
/// Only convex ridges and rims are [edges](SurfaceEdge). Contacts therefore do not catch on flat or concave
/// sides between triangles.
///
/// ```
/// use motorium_robots::{TriangleMesh, TriangleSurface};
/// use nalgebra::{Point3, Vector3};
///
/// let corner = |x, y| Vector3::new(x, y, 0.0);
/// let points = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
/// let square = TriangleSurface::new(&TriangleMesh { points, triangles: vec![[0, 1, 2], [0, 2, 3]] });
/// let mut rim = 0;
/// square.visit_edges(&Point3::new(-1.0, -1.0, -1.0), &Point3::new(2.0, 2.0, 1.0), &mut |_, _| rim += 1);
/// assert_eq!(rim, 4, "the diagonal is no edge");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleSurface {
    triangles: Vec<SurfaceTriangle>,
    edges: Vec<SurfaceEdge>,
    tree: BoxTree,
    edge_tree: BoxTree,
    reach: f64,
}

/// Sine of the angle between two triangles below which they count as coplanar.
const FLAT: f64 = 1e-3;

/// Area below which triangles have no normal \[m2\].
const NO_AREA: f64 = 1e-16;

impl TriangleSurface {
    /// Creates the surface of a mesh.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let mesh = mesh.welded();
        let at = |index: u32| mesh.points[index as usize];
        let normal_of = |[a, b, c]: [u32; 3]| {
            let across = (at(b) - at(a)).cross(&(at(c) - at(a)));
            let length = across.norm();
            (length > NO_AREA).then(|| across / length)
        };
        let (mut kept, mut triangles) = (Vec::new(), Vec::new());
        for triangle in &mesh.triangles {
            let Some(normal) = normal_of(*triangle) else { continue };
            let corners = triangle.map(|index| Point3::from(at(index)));
            kept.push(*triangle);
            triangles.push(SurfaceTriangle { corners, normal, valley: [0.0; 3] });
        }
        // Both triangles of each side: index and number of the side.
        let mut sides: HashMap<(u32, u32), Vec<(usize, usize)>> = HashMap::new();
        for (index, corners) in kept.iter().enumerate() {
            for side in 0..3 {
                let (a, b) = (corners[side], corners[(side + 1) % 3]);
                sides.entry((a.min(b), a.max(b))).or_default().push((index, side));
            }
        }
        let mut keys: Vec<_> = sides.keys().copied().collect();
        keys.sort_unstable();
        let mut edges = Vec::new();
        for (a, b) in keys {
            let ends = [Point3::from(at(a)), Point3::from(at(b))];
            match sides[&(a, b)][..] {
                [(one, side)] => {
                    let SurfaceTriangle { corners, normal, .. } = triangles[one];
                    let along = corners[(side + 1) % 3] - corners[side];
                    let away = along.cross(&normal);
                    edges.push(SurfaceEdge { ends, normals: [normal, away / away.norm()] });
                }
                [(one, side), (two, other), ..] => {
                    let normals = [triangles[one].normal, triangles[two].normal];
                    let apex = triangles[two].corners[(other + 2) % 3];
                    let rise = normals[0].dot(&(apex - ends[0]));
                    let bend = normals[0].cross(&normals[1]).norm();
                    // A surface folded back onto itself: a plate without thickness.
                    let folded = normals[0].dot(&normals[1]) < 0.0 && bend < FLAT;
                    if bend < FLAT && !folded {
                        continue;
                    }
                    if rise > 0.0 && !folded {
                        let apex = triangles[one].corners[(side + 2) % 3];
                        triangles[one].valley[side] = rise;
                        triangles[two].valley[other] = normals[1].dot(&(apex - ends[0])).max(0.0);
                    } else {
                        edges.push(SurfaceEdge { ends, normals });
                    }
                }
                [] => {}
            }
        }
        let around = |points: &[Point3<f64>]| {
            let all = points.iter().map(|point| V3::from(point.coords));
            all.fold(
                (
                    V3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
                    V3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
                ),
                |(low, high), point| (least(low, point), most(high, point)),
            )
        };
        let boxes: Vec<Bounds> = triangles.iter().map(|triangle| around(&triangle.corners)).collect();
        let edge_boxes: Vec<Bounds> = edges.iter().map(|edge| around(&edge.ends)).collect();
        let corners = triangles.iter().flat_map(|triangle| triangle.corners);
        let reach = corners.map(|corner| corner.coords.norm()).fold(0.0, f64::max);
        let (tree, edge_tree) = (BoxTree::new(&boxes), BoxTree::new(&edge_boxes));
        Self { triangles, edges, tree, edge_tree, reach }
    }

    /// Returns the reach of the surface \[m\]: the radius of its bounding sphere about the origin.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns the triangles of the surface.
    pub fn triangles(&self) -> &[SurfaceTriangle] {
        &self.triangles
    }

    /// Returns the eight corners of the axis-aligned bounding box \[m\].
    pub fn corners(&self) -> Vec<Vector3<f64>> {
        let Some((low, high)) = self.tree.bounds() else { return Vec::new() };
        let pick =
            |corner: u32, bit: u32, low: f64, high: f64| if corner >> bit & 1 == 0 { low } else { high };
        let corner = |corner: u32| {
            Vector3::new(
                pick(corner, 0, low.x, high.x),
                pick(corner, 1, low.y, high.y),
                pick(corner, 2, low.z, high.z),
            )
        };
        (0..8).map(corner).collect()
    }

    /// Calls `visit` with the index and the triangle for each triangle whose bounding box intersects the box
    /// from `low` to `high` \[m\].
    pub fn visit(
        &self,
        low: &Point3<f64>,
        high: &Point3<f64>,
        visit: &mut dyn FnMut(usize, &SurfaceTriangle),
    ) {
        let wanted: Bounds = (low.coords.into(), high.coords.into());
        self.tree.visit(|bounds| overlap(bounds, &wanted), |index| visit(index, &self.triangles[index]));
    }

    /// Calls `visit` with the index and the edge for each edge whose bounding box may intersect the box from
    /// `low` to `high` \[m\].
    pub fn visit_edges(
        &self,
        low: &Point3<f64>,
        high: &Point3<f64>,
        visit: &mut dyn FnMut(usize, &SurfaceEdge),
    ) {
        let wanted: Bounds = (low.coords.into(), high.coords.into());
        self.edge_tree.visit(|bounds| overlap(bounds, &wanted), |index| visit(index, &self.edges[index]));
    }

    /// Returns the distance \[m\] along a ray to the first triangle that it hits within `range` \[m\], and
    /// the normal of this triangle on the side of the ray's origin. Returns `None` if the ray hits no
    /// triangle.
    #[inline]
    pub fn meet(&self, origin: V3, direction: V3, range: f64) -> Option<(f64, V3)> {
        let inverse = V3::new(1.0 / direction.x, 1.0 / direction.y, 1.0 / direction.z);
        let nearest = core::cell::Cell::new(range);
        let mut normal = None;
        self.tree.visit(
            |bounds| is_met(bounds, origin, inverse, nearest.get()),
            |index| {
                let triangle = &self.triangles[index];
                let [a, b, c] = triangle.corners.map(|corner| V3::from(corner.coords));
                // Moeller and Trumbore (1997).
                let (one, two) = (b - a, c - a);
                let across = direction.cross(two);
                let volume = one.dot(across);
                if volume == 0.0 {
                    return;
                }
                let from = origin - a;
                let u = from.dot(across) / volume;
                let turned = from.cross(one);
                let v = direction.dot(turned) / volume;
                let distance = two.dot(turned) / volume;
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance < nearest.get() {
                    nearest.set(distance);
                    let facing = V3::from(triangle.normal);
                    normal = Some(if facing.dot(direction) > 0.0 { -facing } else { facing });
                }
            },
        );
        normal.map(|normal| (nearest.get(), normal))
    }
}

impl SurfaceTriangle {
    /// Returns the point of the triangle that is nearest to `point` \[m\].
    pub fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        let corners = self.corners.map(|corner| V3::from(corner.coords));
        Point3::from(Vector3::from(nearest_on_triangle(point.coords.into(), corners)))
    }

    /// Returns `true` if the triangle is below `point`, seen along the triangle's normal. At a side in a
    /// [`valley`](Self::valley), the point may be beyond the side by up to `slack` \[m\] or the depth of the
    /// valley, whichever is smaller. Points farther out may be above the neighbouring triangle.
    pub fn is_below(&self, point: &Point3<f64>, slack: f64) -> bool {
        (0..3).all(|side| {
            let (start, end) = (self.corners[side], self.corners[(side + 1) % 3]);
            let inward = self.normal.cross(&(end - start));
            let inside = inward.dot(&(point - start));
            let rise = self.valley[side];
            let least = if rise > 0.0 { -slack.min(rise) } else { -1e-9 };
            inside >= least * inward.norm()
        })
    }
}

impl SurfaceEdge {
    /// Returns `true` if a unit vector points out of the edge, between the normals of both its triangles.
    pub fn points_out(&self, direction: &Vector3<f64>) -> bool {
        let along = (self.ends[1] - self.ends[0]).normalize();
        let across = direction - along * direction.dot(&along);
        let length = across.norm();
        if length < 1e-9 {
            return false;
        }
        let across = across / length;
        let least = self.normals[0].dot(&self.normals[1]) - 1e-6;
        // between both normals by angle: closer to each normal than the normals are to each other
        across.dot(&self.normals[0]) >= least && across.dot(&self.normals[1]) >= least
    }
}

/// Returns the point of the triangle `a`, `b`, `c` that is nearest to `p`.
#[inline]
pub fn nearest_on_triangle(p: V3, [a, b, c]: [V3; 3]) -> V3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let scale = 1.0 / (va + vb + vc);
    a + ab * (vb * scale) + ac * (vc * scale)
}
