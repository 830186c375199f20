//! Witnesses: points of two solids that may become their nearest points when the solids rotate.

use nalgebra::{Point3, Vector2, Vector3};

use super::distance::{Collisions, Proximity};
use super::pairs::CollisionModel;
use super::polygon::{clip, convex_corners};
use super::solid::Solid;
use super::support::{Core, Placed};
use super::witness_room::{Seen, TURNS, WitnessRoom};
use crate::math::{M3, V3};

/// Rotation after which another point may become the nearest \[rad\].
const TILT: f64 = 0.05;
/// Areas \[m2\] below rounding, and lengths \[m\] within which points coincide.
const NO_AREA: f64 = 1e-13;
const SAME: f64 = 1e-6;

/// One solid of a pair, seen along the normal.
struct View<'a> {
    solid: &'a Solid,
    rotation: &'a M3,
    position: V3,
    /// Outward direction, towards the other solid.
    outward: V3,
    /// Nearest point of the solid.
    centre: V3,
    /// Axes perpendicular to the normal.
    axes: [V3; 2],
}

impl View<'_> {
    /// Finds the corners of the outermost part, at this pose or after a rotation by [`TILT`].
    fn near(&self, points: &mut Vec<Seen>, corners: &mut Vec<Seen>) {
        let placed = Placed { core: &self.solid.core, rotation: self.rotation, position: self.position };
        let [x, y] = self.axes;
        points.clear();
        points.push(Seen { place: Vector2::zeros(), point: self.centre });
        for (along, across) in TURNS {
            let tilted = self.outward + (x * along + y * across) * TILT;
            let point = placed.farthest(tilted) + self.outward * self.solid.radius;
            let from = point - self.centre;
            points.push(Seen { place: Vector2::new(from.dot(x), from.dot(y)), point });
        }
        convex_corners(points, |seen| seen.place, corners);
        flatten(corners);
    }

    /// Returns the point of the solid at a position within the corners: on one of the triangles between two
    /// corners and the nearest point.
    fn point_at(&self, place: Vector2<f64>, corners: &[Seen]) -> V3 {
        let [x, y] = self.axes;
        if self.solid.is_half_space() {
            return self.centre + x * place.x + y * place.y;
        }
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let area = a.place.perp(&b.place);
            if area <= NO_AREA {
                continue;
            }
            let (of_a, of_b) = (place.perp(&b.place) / area, a.place.perp(&place) / area);
            if of_a >= -1e-9 && of_b >= -1e-9 && of_a + of_b <= 1.0 + 1e-9 {
                return self.centre + (a.point - self.centre) * of_a + (b.point - self.centre) * of_b;
            }
        }
        // on a line, or on the edge of the area
        let along = |corner: &&Seen| corner.place.dot(&place) / corner.place.norm().max(SAME);
        let Some(end) = corners.iter().max_by(|a, b| along(a).total_cmp(&along(b))) else {
            return self.centre;
        };
        let share = (end.place.dot(&place) / end.place.norm_squared().max(SAME * SAME)).clamp(0.0, 1.0);
        self.centre + (end.point - self.centre) * share
    }
}

impl Collisions {
    /// Maximum number of [witnesses](Self::witnesses) of a pair.
    pub const MOST_WITNESSES: usize = 12;

    /// Appends witnesses of a pair to `found`: pairs of opposite points that may become the nearest points
    /// after a small rotation. Their number is at most `most`, and never above
    /// [`MOST_WITNESSES`](Self::MOST_WITNESSES). `nearest` is the result of [`distance`](Self::distance) at
    /// the current poses; its points are not appended. Each witness has the normal of `nearest`. The distance
    /// of a witness is the gap along this normal, which is at least the distance of `nearest`.
    ///
    /// Between a flat face and an edge or another face, the nearest points jump from corner to corner as the
    /// solids rotate. The [gradient](CollisionModel::distance_jacobian) at one corner therefore does not
    /// describe the distances at the remaining corners. The witnesses are the corners of the overlap region:
    /// the points farthest along the normal, or along a normal tilted by 0.05 rad. Spheres,
    /// [surfaces](super::MeshMode::Surface), and pairs for which only a [bound](Proximity::is_bound) is known
    /// have no witnesses. If there are more witnesses than `most`, the function keeps those which contribute
    /// most to the overlap region.
    ///
    /// ```
    /// use motorium_robots::{CollisionModel, CollisionOptions, Collisions, Geometry, MeshMode, load};
    /// use nalgebra::{Isometry3, Vector3};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?.model;
    /// let mut solids = CollisionModel::new(&panda, &CollisionOptions::default())?;
    /// let cube = |side: f64| Geometry::Box { size: Vector3::repeat(side) };
    /// solids.add_obstacle("table", Isometry3::translation(2.0, 0.0, 0.0), cube(1.0), MeshMode::default())?;
    /// let pose = Isometry3::translation(2.1, 0.0, 0.62);
    /// solids.add_free_object("crate", pose, cube(0.2), MeshMode::default())?;
    /// let mut distances = Collisions::new(&solids);
    /// let nearest = distances.distance(&solids, solids.pairs().len() - 1);
    /// let mut corners = Vec::new();
    /// distances.witnesses(&solids, &nearest, Collisions::MOST_WITNESSES, &mut corners);
    /// assert_eq!(solids.pair_links(nearest.pair), ["table", "crate"]);
    /// assert!(corners.len() >= 3 && corners.iter().all(|corner| (corner.distance - 0.02).abs() < 1e-9));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn witnesses(
        &mut self,
        model: &CollisionModel,
        nearest: &Proximity,
        most: usize,
        found: &mut Vec<Proximity>,
    ) {
        let pair = model.pairs[nearest.pair];
        let solids = pair.map(|solid| &model.solids[solid]);
        let smooth = |solid: &&Solid| solid.core == Core::Point || solid.is_surface();
        if solids.iter().any(smooth) || nearest.is_bound || most == 0 {
            return;
        }
        let Self { rotations, positions, room, .. } = self;
        let WitnessRoom { points, corners, overlap, clipped } = room;
        let normal = V3::from(nearest.normal.into_inner());
        // points on the rim of a cylinder stay in place as the other solid rotates
        let round = pair.into_iter().find(|solid| matches!(model.solids[*solid].core, Core::Cylinder(..)));
        let axes = square_to(normal, &rotations[round.unwrap_or(pair[0])]);
        let view = |side: usize, outward: V3| View {
            solid: solids[side],
            rotation: &rotations[pair[side]],
            position: positions[pair[side]],
            outward,
            centre: V3::from(Vector3::from(nearest.points[side].coords)),
            axes,
        };
        let views = [view(0, normal), view(1, -normal)];
        for (view, corners) in views.iter().zip(&mut *corners) {
            if !view.solid.is_half_space() {
                view.near(points, corners);
            }
        }
        overlap.clear();
        match solids.map(Solid::is_half_space) {
            [true, _] => overlap.extend(corners[1].iter().map(|seen| seen.place)),
            [_, true] => overlap.extend(corners[0].iter().map(|seen| seen.place)),
            _ => intersect(corners, overlap, clipped),
        }
        keep_corners(overlap, most.min(Self::MOST_WITNESSES));
        for place in &*overlap {
            let ends = [0, 1].map(|side| views[side].point_at(*place, &corners[side]));
            found.push(Proximity {
                pair: nearest.pair,
                distance: (ends[1] - ends[0]).dot(normal),
                points: ends.map(|end| Point3::from(Vector3::from(end))),
                normal: nearest.normal,
                is_bound: false,
            });
        }
    }
}

/// Keeps only the ends of a nearly degenerate polygon.
fn flatten(corners: &mut Vec<Seen>) {
    let farthest = |from: Vector2<f64>| {
        let distance = |seen: &&Seen| (seen.place - from).norm_squared();
        corners.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
    };
    let Some(first) = farthest(Vector2::zeros()) else { return };
    let Some(last) = farthest(first.place) else { return };
    let way = last.place - first.place;
    if corners.iter().all(|seen| way.perp(&(seen.place - first.place)).abs() <= SAME * way.norm()) {
        corners.clear();
        corners.extend([first, last]);
    }
}

/// Finds the corners of the intersection of two convex polygons, each of which may be degenerate.
fn intersect(
    [first, second]: &[Vec<Seen>; 2],
    overlap: &mut Vec<Vector2<f64>>,
    clipped: &mut Vec<Vector2<f64>>,
) {
    if let ([a, b], [c, d]) = (&**first, &**second) {
        let (from, way) = (a.place, b.place - a.place);
        let (length, other) = (way.norm(), d.place - c.place);
        // crossing lines have a single nearest point
        if length < SAME || way.perp(&other).abs() > 2.0 * TILT * length * other.norm() {
            return;
        }
        let along = way / length;
        let [c, d] = [c, d].map(|end| along.dot(&(end.place - from)));
        let (low, high) = (c.min(d).max(0.0), c.max(d).min(length));
        if low < high {
            overlap.extend([low, high].map(|at| from + along * at));
        }
        return;
    }
    let (subject, clipper) = if second.len() > 2 { (first, second) } else { (second, first) };
    overlap.extend(subject.iter().map(|seen| seen.place));
    for (a, b) in clipper.iter().zip(clipper.iter().cycle().skip(1)) {
        clip(overlap, [a.place, b.place], NO_AREA, clipped);
        std::mem::swap(overlap, clipped);
    }
}

/// Keeps the corners away from the nearest point; if there are too many, the corners that contribute most to
/// the region.
fn keep_corners(overlap: &mut Vec<Vector2<f64>>, most: usize) {
    let mut kept = 0;
    for index in 0..overlap.len() {
        let place = overlap[index];
        let known = overlap[..kept].iter().any(|other| (other - place).norm() < SAME);
        if place.norm() >= SAME && !known {
            overlap[kept] = place;
            kept += 1;
        }
    }
    overlap.truncate(kept);
    while overlap.len() > most {
        let count = overlap.len();
        let area = |index: usize| {
            let [before, here, after] = [index + count - 1, index, index + 1].map(|i| overlap[i % count]);
            (here - before).perp(&(after - here)).abs()
        };
        let least = (0..count).min_by(|a, b| area(*a).total_cmp(&area(*b)));
        overlap.remove(least.unwrap_or_default());
    }
}

/// Two orthonormal axes normal to a unit direction, aligned with an axis of a solid.
fn square_to(normal: V3, solid: &M3) -> [V3; 2] {
    let along = if solid.x.dot(normal).abs() < 0.8 { solid.x } else { solid.y };
    let x = along - normal * along.dot(normal);
    let x = x * (1.0 / x.dot(x).sqrt());
    [x, normal.cross(x)]
}
