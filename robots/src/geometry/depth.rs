//! Penetration depth of two convex cores by the expanding polytope algorithm (van den Bergen 2001) in fixed
//! memory.
//!
//! The differences between points of the first core and points of the second core form a convex set. If the
//! cores overlap, this set contains the origin. A polytope inside the set grows at its face nearest to the
//! origin until that face is on the set's boundary. This face then gives the shortest translation that
//! separates the cores.

use parry3d_f64::query::gjk::CsoPoint;

use super::support::Placed;
use crate::math::{V3, v3, vector};

/// Maximum number of corners; each iteration of the search adds one.
const CORNERS: usize = 128;
/// Maximum number of faces of a closed triangle surface with this number of corners (Euler).
const FACES: usize = 2 * CORNERS;

/// Distance within rounding at which a face counts as on the boundary \[m\].
const ON_BOUNDARY: f64 = 2e-14;
/// Distance below which a search without progress is limited by rounding \[m\].
const STALLED: f64 = 1e-11;
/// Depth below a face's plane at which a corner counts as in the plane \[m\].
const IN_PLANE: f64 = 1e-13;
/// Thickness below which a set counts as flat \[m\].
const FLAT: f64 = 1e-10;

/// A difference of two points, with the points.
#[derive(Clone, Copy)]
struct Corner {
    at: V3,
    first: V3,
    second: V3,
}

impl Corner {
    /// Returns the corner farthest along `direction`.
    #[inline(always)]
    fn farthest([first, second]: &[Placed<'_>; 2], direction: V3) -> Self {
        let still = parry3d_f64::math::Pose::IDENTITY;
        let found = CsoPoint::from_shapes(&still, first, second, vector(direction));
        Self { at: v3(found.point), first: v3(found.orig1), second: v3(found.orig2) }
    }
}

/// A triangle; seen from outside, its corners are counter-clockwise.
#[derive(Clone, Copy)]
struct Face {
    corners: [usize; 3],
    /// Neighbours across the edges that start at the corners.
    neighbours: [usize; 3],
    /// `true` if the face is part of the surface; otherwise its slot is free.
    alive: bool,
    normal: V3,
    /// Distance of the face's plane from the origin, along the normal.
    distance: f64,
}

/// The polytope. Only [`new`](Self::new) allocates.
pub(super) struct Polytope {
    corners: Vec<Corner>,
    faces: Vec<Face>,
    free: Vec<usize>,
    /// Edges of the faces around the visible region, in order.
    horizon: Vec<(usize, usize)>,
}

impl Polytope {
    pub(super) fn new() -> Self {
        Self {
            corners: Vec::with_capacity(CORNERS),
            faces: Vec::with_capacity(FACES),
            free: Vec::with_capacity(FACES),
            horizon: Vec::with_capacity(3 * FACES),
        }
    }

    /// For two overlapping cores, returns the deepest point of each in the other, and the direction of the
    /// shortest separation from the first to the second. `None` if all differences are collinear.
    pub(super) fn search(&mut self, pair: &[Placed<'_>; 2]) -> Option<(V3, V3, V3)> {
        self.begin(pair)?;
        // the separation is at most the best one proven so far
        let (mut best, mut least) = (self.faces[self.nearest()?], f64::INFINITY);
        loop {
            let nearest = self.nearest()?;
            let face = self.faces[nearest];
            let corner = Corner::farthest(pair, face.normal);
            let proven = corner.at.dot(face.normal);
            let gains = proven < least;
            if gains {
                (best, least) = (face, proven);
            }
            let gap = least - face.distance;
            if gap <= ON_BOUNDARY || !gains && gap <= STALLED || !self.grow(nearest, corner) {
                let (p, q) = self.witness(best.normal * least);
                return Some((p, q, best.normal));
            }
        }
    }

    /// Starts with a tetrahedron, or both sides of a triangle if there is no fourth point.
    fn begin(&mut self, pair: &[Placed<'_>; 2]) -> Option<()> {
        self.corners.clear();
        self.faces.clear();
        self.free.clear();
        let axes = [V3::new(1.0, 0.0, 0.0), V3::new(0.0, 1.0, 0.0), V3::new(0.0, 0.0, 1.0)];
        let (start, end) = axes.into_iter().find_map(|axis| {
            let (start, end) = (Corner::farthest(pair, -axis), Corner::farthest(pair, axis));
            let way = end.at - start.at;
            (way.dot(way) > FLAT * FLAT).then_some((start, end))
        })?;
        let way = end.at - start.at;
        let along = way * (1.0 / way.dot(way).sqrt());
        let least = axes.into_iter().min_by(|a, b| a.dot(along).abs().total_cmp(&b.dot(along).abs()))?;
        let across = along.cross(least);
        let from_line = |corner: &Corner| {
            let arm = along.cross(corner.at - start.at);
            arm.dot(arm)
        };
        let side = [across, -across, along.cross(across), -along.cross(across)]
            .map(|direction| Corner::farthest(pair, direction))
            .into_iter()
            .max_by(|a, b| from_line(a).total_cmp(&from_line(b)))?;
        if from_line(&side) <= FLAT * FLAT {
            return None;
        }
        let normal = along.cross(side.at - start.at);
        let normal = normal * (1.0 / normal.dot(normal).sqrt());
        let height = |corner: &Corner| normal.dot(corner.at - start.at);
        let (above, below) = (Corner::farthest(pair, normal), Corner::farthest(pair, -normal));
        let (tip, over) = if height(&above) >= -height(&below) { (above, true) } else { (below, false) };
        self.corners.extend([start, end, side]);
        if height(&tip).abs() <= FLAT {
            self.add_face([0, 1, 2], [1, 1, 1]);
            self.add_face([0, 2, 1], [0, 0, 0]);
            return Some(());
        }
        self.corners.push(tip);
        let (a, b) = if over { (1, 2) } else { (2, 1) };
        self.add_face([0, b, a], [3, 2, 1]);
        self.add_face([0, a, 3], [0, 2, 3]);
        self.add_face([a, b, 3], [0, 3, 1]);
        self.add_face([b, 0, 3], [0, 1, 2]);
        Some(())
    }

    /// Returns the index of the new face.
    fn add_face(&mut self, corners: [usize; 3], neighbours: [usize; 3]) -> usize {
        let [a, b, c] = corners.map(|corner| self.corners[corner].at);
        let normal = (b - a).cross(c - a);
        let length = normal.dot(normal).sqrt();
        // a degenerate face is neither the nearest nor ever visible
        let (normal, distance) = if length > f64::MIN_POSITIVE {
            let normal = normal * (1.0 / length);
            (normal, normal.dot(a))
        } else {
            (V3::ZERO, f64::INFINITY)
        };
        let face = Face { corners, neighbours, alive: true, normal, distance };
        match self.free.pop() {
            Some(place) => {
                self.faces[place] = face;
                place
            }
            None => {
                self.faces.push(face);
                self.faces.len() - 1
            }
        }
    }

    fn nearest(&self) -> Option<usize> {
        let alive = self.faces.iter().enumerate().filter(|(_, face)| face.alive);
        alive.min_by(|(_, a), (_, b)| a.distance.total_cmp(&b.distance)).map(|(index, _)| index)
    }

    /// Adds `corner`: replaces `face` and all faces visible from it by faces from the horizon to the corner.
    /// Returns `false` without growing if memory is exhausted or rounding has torn the region.
    fn grow(&mut self, face: usize, corner: Corner) -> bool {
        if self.corners.len() == CORNERS {
            return false;
        }
        self.horizon.clear();
        self.faces[face].alive = false;
        for edge in 0..3 {
            self.find_horizon(corner.at, face, edge);
        }
        let count = self.horizon.len();
        // Traverse the horizon from corner to corner; slots of covered faces are free.
        let edge = |index: usize| {
            let (face, edge) = self.horizon[index % count];
            let corners = self.faces[face].corners;
            [corners[(edge + 1) % 3], corners[edge]]
        };
        let closed = count >= 3 && (0..count).all(|index| edge(index)[1] == edge(index + 1)[0]);
        self.free.clear();
        let places = self.faces.iter().enumerate();
        self.free.extend(places.filter(|(_, face)| !face.alive).map(|(place, _)| place));
        if !closed || self.faces.len() - self.free.len() + count > FACES {
            return false;
        }
        let added = self.corners.len();
        self.corners.push(corner);
        let (mut first, mut last) = (0, 0);
        for index in 0..count {
            let (outer, edge) = self.horizon[index];
            let corners = self.faces[outer].corners;
            let place = self.add_face([corners[(edge + 1) % 3], corners[edge], added], [outer, 0, last]);
            self.faces[outer].neighbours[edge] = place;
            if index == 0 {
                first = place;
            } else {
                self.faces[last].neighbours[1] = place;
            }
            last = place;
        }
        self.faces[last].neighbours[1] = first;
        self.faces[first].neighbours[2] = last;
        true
    }

    /// Crosses an edge of a visible face: continues across visible faces, and records the edge of an
    /// invisible one.
    fn find_horizon(&mut self, from: V3, face: usize, edge: usize) {
        let Face { corners, neighbours, .. } = self.faces[face];
        let (place, begin) = (neighbours[edge], corners[(edge + 1) % 3]);
        let neighbour = &mut self.faces[place];
        // the same edge has the opposite direction there
        let Some(back) = neighbour.corners.iter().position(|&corner| corner == begin) else { return };
        if !neighbour.alive {
            return;
        }
        // Coplanar faces count as visible: a corner beyond an edge would give a degenerate face.
        if neighbour.normal.dot(from) - neighbour.distance < -IN_PLANE {
            self.horizon.push((place, back));
            return;
        }
        neighbour.alive = false;
        self.find_horizon(from, place, (back + 1) % 3);
        self.find_horizon(from, place, (back + 2) % 3);
    }

    /// Returns the points that correspond to the projection of the origin on the boundary. A facet of the set
    /// consists of several faces, some of them slivers with inaccurate planes; the face nearest to the
    /// projection is used.
    fn witness(&self, foot: V3) -> (V3, V3) {
        let (mut nearest, mut found) = (f64::INFINITY, (V3::ZERO, V3::ZERO));
        for face in self.faces.iter().filter(|face| face.alive) {
            let corners = face.corners.map(|corner| &self.corners[corner]);
            let shares = nearest_shares(foot, corners.map(|corner| corner.at));
            let mix = |part: fn(&Corner) -> V3| {
                corners.iter().zip(shares).fold(V3::ZERO, |sum, (corner, share)| sum + part(corner) * share)
            };
            let miss = mix(|corner| corner.at) - foot;
            let miss = miss.dot(miss);
            if miss < nearest {
                (nearest, found) = (miss, (mix(|corner| corner.first), mix(|corner| corner.second)));
            }
        }
        found
    }
}

/// Barycentric coordinates of the point of a triangle nearest to `point`, by its Voronoi regions (Ericson
/// 2005, section 5.1.5).
fn nearest_shares(point: V3, [a, b, c]: [V3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let slopes = |corner: V3| (ab.dot(point - corner), ac.dot(point - corner));
    let ((d1, d2), (d3, d4), (d5, d6)) = (slopes(a), slopes(b), slopes(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let (u, v, w) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if w <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = d1 / (d1 - d3);
        return [1.0 - share, share, 0.0];
    }
    if v <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = d2 / (d2 - d6);
        return [1.0 - share, 0.0, share];
    }
    if u <= 0.0 && d4 >= d3 && d5 >= d6 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - share, share];
    }
    let scale = 1.0 / (u + v + w);
    [u * scale, v * scale, w * scale]
}
