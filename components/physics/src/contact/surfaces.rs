//! Contact points of a convex collider with the triangles of a mesh.
//!
//! [Features](super::features) of the collider touch the triangles below them. Round features touch an edge
//! or a corner of the mesh if that is closer than all triangles. Protruding
//! [edges](motorium_robots::SurfaceEdge) of the mesh touch faces and edges of the collider. Sides between
//! coplanar triangles, and sides in valleys, are not edges, so that objects slide over them and touch only
//! the triangles. A triangle touches colliders whose centre is in front of it.

use motorium_robots::{ConvexShape, SurfaceEdge, SurfaceTriangle, TriangleSurface};
use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::colliders::Collider;
use super::features::{ContactGeometry, Feature};
use super::hulls::{Faces, SIDES};
use super::normals::Normals;
use super::pair::AHEAD;

/// Largest number of triangles in different planes that a feature touches simultaneously.
const MOST: usize = 4;

/// Triangles whose normals differ by less than 18 degrees touch as one: the cosine of 18 degrees.
const ALIKE: f64 = 0.95;

/// Depth behind a triangle up to which it pushes a feature out \[m\].
const DEPTH: f64 = 0.03;

/// Smallest feature number of contacts with edges.
const EDGES: u32 = 1 << 29;

/// Two edges touch if their normal separates better than the face by this distance \[m\].
const CROSSING: f64 = 1e-5;

/// The normal of two edges may be beyond the normals of the faces beside them by this sine of an angle.
const BETWEEN: f64 = 1e-6;

/// Squared sine of the angle below which two edges count as parallel.
const PARALLEL: f64 = 1e-6;

/// Squared sine of the angle below which an edge touches a round side along a line.
const PARALLEL_SIDES: f64 = 4e-4;

/// Lines shared by an edge and a round side that are shorter than this count as points \[m\].
const SHARED: f64 = 5e-5;

/// A triangle touched by a feature.
#[derive(Clone, Copy)]
struct Touch {
    distance: f64,
    normal: Vector3<f64>,
    /// True for a contact with the face, false for a side or corner.
    over: bool,
    /// Middle of the triangle.
    middle: Point3<f64>,
    /// A point in the triangle's plane.
    corner: Point3<f64>,
}

/// A collider in the frame of the mesh.
pub(super) struct Mover<'a> {
    pub(super) collider: &'a Collider,
    pub(super) pose: IsometryMatrix3<f64>,
    pub(super) centre: Point3<f64>,
    pub(super) margin: f64,
    /// The surface is a terrain. Its corners touch as peaks, so that edges have no contacts there.
    pub(super) on_terrain: bool,
}

/// Passes the contact points of a collider with the triangles of a mesh closer than `margin` \[m\] to
/// `found`: the feature number, the point, the normal from the mesh to the collider, and the distance.
/// Returns a lower bound of the distance between both \[m\].
pub(super) fn collide(
    (mover, mover_pose): (&Collider, &IsometryMatrix3<f64>),
    (surface, surface_pose): (&TriangleSurface, &IsometryMatrix3<f64>),
    margin: f64,
    found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) -> f64 {
    let pose = surface_pose.inv_mul(mover_pose);
    let centre = Point3::from(pose.translation.vector);
    let extent = extent(&mover.shape, &pose);
    let reach = |more: f64| extent.add_scalar(more);
    let mut any = false;
    surface.visit(&(centre - reach(margin + AHEAD)), &(centre + reach(margin + AHEAD)), &mut |_, _| {
        any = true;
    });
    if !any {
        return margin + AHEAD;
    }
    let mover = Mover { collider: mover, pose, centre, margin, on_terrain: false };
    let mut found = |number: u32, point: Point3<f64>, normal: Vector3<f64>, distance: f64| {
        found(number, surface_pose * point, surface_pose.rotation * normal, distance);
    };
    if mover.collider.shape.turns_features() {
        mover.rims(surface, &extent, &mut found);
    } else {
        // These features are the same in every direction.
        let all = |_: &SurfaceTriangle| true;
        mover.collider.shape.features(&Vector3::z(), &mut |feature| {
            mover.feature(surface, (&feature, &all), &mut found);
        });
    }
    if !matches!(mover.collider.shape, ConvexShape::Sphere { .. }) {
        let (low, high) = (centre - reach(margin), centre + reach(margin));
        surface.visit_edges(&low, &high, &mut |index, edge| {
            let number = EDGES | (index as u32 & 0x07ff_ffff) << 1;
            let mut found = |end, point, normal, distance| found(number | end, point, normal, distance);
            mover.edge(edge, &mut found);
        });
    }
    f64::NEG_INFINITY
}

/// Returns the half extents, along the mesh axes, of the box around a shape centred at its origin \[m\].
fn extent(shape: &ConvexShape, pose: &IsometryMatrix3<f64>) -> Vector3<f64> {
    match shape {
        ConvexShape::Box { half } => pose.rotation.matrix().abs() * half,
        shape => Vector3::repeat(shape.bounding_radius()),
    }
}

impl Mover<'_> {
    /// Handles the rims of a cylinder, or the corners of a dense hull. Triangles of each normal touch the
    /// points that are deepest against that normal.
    fn rims(
        &self,
        surface: &TriangleSurface,
        extent: &Vector3<f64>,
        found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
    ) {
        let reach = extent.add_scalar(self.margin);
        let mut normals = Normals::default();
        surface.visit(&(self.centre - reach), &(self.centre + reach), &mut |_, triangle| {
            let height = triangle.normal.dot(&(self.centre - triangle.corners[0]));
            if height > 0.0 && height - self.collider.shape.bounding_radius() < self.margin {
                normals.add(&triangle.normal);
            }
        });
        for (number, normal) in normals.all().iter().enumerate() {
            let towards = self.pose.rotation.inverse_transform_vector(&-normal);
            let takes = |triangle: &SurfaceTriangle| normals.is(number, &triangle.normal);
            self.collider.shape.features(&towards, &mut |feature| {
                let feature = Feature { index: Normals::feature(number, feature.index), ..feature };
                self.feature(surface, (&feature, &takes), found);
            });
        }
    }

    /// Tests a feature against the accepted triangles.
    fn feature(
        &self,
        surface: &TriangleSurface,
        (feature, takes): (&Feature, &dyn Fn(&SurfaceTriangle) -> bool),
        found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
    ) {
        let Feature { index, point, radius } = *feature;
        let place = self.pose * Point3::from(point);
        let reach = Vector3::repeat(self.margin.max(DEPTH) + radius);
        let mut touches: [Option<Touch>; MOST] = [None; MOST];
        let mut nearest: Option<Touch> = None;
        let mut side = Side::default();
        surface.visit(&(place - reach), &(place + reach), &mut |_, triangle| {
            if radius == 0.0 {
                side.look(triangle, &place);
            }
            if !takes(triangle) {
                return;
            }
            let touch = if radius > 0.0 {
                self.round(triangle, &place, radius)
            } else {
                self.sharp(triangle, &place)
            };
            let Some(touch) = touch else { return };
            if nearest.is_none_or(|other| touch.distance.abs() < other.distance.abs()) {
                nearest = Some(touch);
            }
            if touch.over {
                keep(&mut touches, touch);
            }
        });
        // A point beyond the far side of a rail is behind the near side, but not inside the rail.
        if side.outside {
            let deepest = -2.0 * self.margin;
            touches.iter_mut().for_each(|slot| *slot = slot.filter(|touch| touch.distance > deepest));
            nearest = nearest.filter(|touch| touch.distance > deepest);
        }
        // A face takes precedence over its sides.
        let beside = nearest.filter(|touch| {
            let faces = touches.iter().flatten();
            !touch.over && !faces.into_iter().any(|face| face.distance <= touch.distance + 1e-12)
        });
        for (slot, touch) in touches.iter().flatten().chain(&beside).enumerate() {
            let middle = place - touch.normal * (radius + 0.5 * touch.distance);
            found(index << 3 | slot as u32, middle, touch.normal, touch.distance);
        }
    }

    /// Returns the contact of a triangle with a corner of the collider above it.
    fn sharp(&self, triangle: &SurfaceTriangle, place: &Point3<f64>) -> Option<Touch> {
        let corner = triangle.corners[0];
        let distance = triangle.normal.dot(&(place - corner));
        let in_front = triangle.normal.dot(&(self.centre - corner)) > 0.0;
        if distance >= self.margin || distance < -DEPTH || !in_front || !triangle.is_below(place, DEPTH) {
            return None;
        }
        Some(Touch { distance, normal: triangle.normal, over: true, middle: middle(triangle), corner })
    }

    /// Returns the contact of a triangle near the centre of a sphere.
    fn round(&self, triangle: &SurfaceTriangle, place: &Point3<f64>, radius: f64) -> Option<Touch> {
        let corner = triangle.corners[0];
        let height = triangle.normal.dot(&(place - corner));
        let out = place - triangle.nearest(place);
        let length = out.norm();
        let over = triangle.is_below(place, 0.0);
        if height <= 0.0 {
            // The centre has passed through the triangle.
            let near = over && -height < radius.min(DEPTH);
            let (distance, normal) = (height - radius, triangle.normal);
            return near.then(|| Touch { distance, normal, over, middle: middle(triangle), corner });
        }
        let distance = length - radius;
        let normal = if over { triangle.normal } else { out / length };
        (distance < self.margin).then(|| Touch { distance, normal, over, middle: middle(triangle), corner })
    }

    /// Passes the one or two contact points of an edge to `found`, with 0 or 1 for the end of their part of
    /// the edge.
    pub(super) fn edge(
        &self,
        edge: &SurfaceEdge,
        found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
    ) {
        let side = match self.collider.shape {
            ConvexShape::Capsule { radius, half_length } => Some(([radius, half_length], true)),
            ConvexShape::Cylinder { radius, half_length } => Some(([radius, half_length], false)),
            _ => None,
        };
        if let Some((size, caps)) = side
            && self.side(edge, size, caps, found)
        {
            return;
        }
        let ends = edge.ends.map(|end| self.pose.inverse_transform_point(&end).coords);
        let mut room = [(Vector3::zeros(), 0.0); SIDES];
        let faces = Faces::from_collider(self.collider, &ends, &mut room);
        let out = |normal: &Vector3<f64>| self.pose.rotation * -normal;
        // The faces that the edge may touch: the two that it penetrates least. Ridges of a terrain cross
        // edges between two faces that neither of them touches.
        let mut best: [Option<(f64, usize, [f64; 2])>; 2] = [None; 2];
        for (face, (normal, height)) in faces.planes().iter().enumerate() {
            if !self.on_terrain && !edge.points_out(&out(normal)) {
                continue;
            }
            let Some(part) = faces.clip(&ends, face) else { continue };
            let depth = part.map(|at| normal.dot(&ends[0].lerp(&ends[1], at)) - height);
            let least = depth[0].min(depth[1]);
            if least >= self.margin || least < -DEPTH {
                continue;
            }
            let place = best.iter().position(|other| other.is_none_or(|(other, ..)| least > other));
            if let Some(place) = place {
                best[1] = if place == 0 { best[0] } else { best[1] };
                best[place] = Some((least, face, part));
            }
        }
        let Some((least, face, part)) = best[0] else { return };
        let touches_face = !self.on_terrain || edge.points_out(&out(&faces.planes()[face].0));
        // If two edges cross, their normal separates better than the face's.
        if let Some((_, other, _)) = best[1]
            && let Some((normal, point, distance)) = self.crossing(edge, &ends, &faces, [face, other])
            && (distance > least + CROSSING || !touches_face)
        {
            if distance < self.margin && distance > -DEPTH {
                found(0, self.pose * Point3::from(point), self.pose.rotation * normal, distance);
            }
            return;
        }
        if !touches_face {
            return;
        }
        let (normal, height) = faces.planes()[face];
        let short = (part[1] - part[0]) * (ends[1] - ends[0]).norm() < 1e-6;
        for (end, at) in (0..).zip(part).take(if short { 1 } else { 2 }) {
            if !self.takes(at) {
                continue;
            }
            let place = ends[0].lerp(&ends[1], at);
            let distance = normal.dot(&place) - height;
            if distance < self.margin {
                let middle = self.pose * Point3::from(place - normal * (0.5 * distance));
                found(end, middle, out(&normal), distance);
            }
        }
    }

    /// Returns `false` for an end of an edge, as a fraction of its length, whose contact is left to a corner.
    fn takes(&self, at: f64) -> bool {
        !self.on_terrain || at > 0.0 && at < 1.0
    }

    /// Finds the contact of an edge with the side of a capsule or a cylinder with this radius and half
    /// length: a point, or the ends of the shared line. Returns `false` if the edge may touch the end of a
    /// shape without round `caps`.
    fn side(
        &self,
        edge: &SurfaceEdge,
        [radius, half_length]: [f64; 2],
        caps: bool,
        found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
    ) -> bool {
        let along = self.pose.rotation * Vector3::z();
        let axis = [-half_length, half_length].map(|z| self.centre + along * z);
        let mut touch = |end: u32, at: f64, near: Point3<f64>, on_axis: Point3<f64>| {
            let out = on_axis - near;
            let length = out.norm();
            let distance = length - radius;
            if self.takes(at) && length > 1e-9 && distance < self.margin && edge.points_out(&(out / length)) {
                let normal = out / length;
                found(end, near + normal * (0.5 * distance), normal, distance);
            }
        };
        let across = edge.ends[1] - edge.ends[0];
        if along.cross(&across).norm_squared() < PARALLEL_SIDES * across.norm_squared() {
            let ends = edge.ends.map(|end| along.dot(&(end - self.centre)));
            let [low, high] = [ends[0].min(ends[1]).max(-half_length), ends[0].max(ends[1]).min(half_length)];
            if high - low > SHARED {
                for (end, at) in (0..).zip([low, high]) {
                    let part = (at - ends[0]) / (ends[1] - ends[0]);
                    touch(end, part, edge.ends[0] + across * part, self.centre + along * at);
                }
                return true;
            }
        }
        let (at, [near, on_axis]) = nearest_of_segments(&edge.ends, &axis);
        // The end is closer than the side.
        let inside = half_length - along.dot(&(on_axis - self.centre)).abs();
        if !caps && inside < (radius - (on_axis - near).norm()).max(1e-9) {
            return false;
        }
        touch(0, at, near, on_axis);
        true
    }

    /// Returns the contact of an edge with the collider's edge between two of its faces, in the frame of the
    /// collider: the normal to it, the point, the distance. `None` if both are parallel.
    fn crossing(
        &self,
        edge: &SurfaceEdge,
        ends: &[Vector3<f64>; 2],
        faces: &Faces<'_>,
        [one, two]: [usize; 2],
    ) -> Option<(Vector3<f64>, Vector3<f64>, f64)> {
        let (one, two) = (faces.planes()[one], faces.planes()[two]);
        let along = (ends[1] - ends[0]).normalize();
        let own = one.0.cross(&two.0);
        let axis = along.cross(&own);
        let square = axis.norm_squared();
        if square < PARALLEL * own.norm_squared() || own.norm_squared() < PARALLEL {
            return None;
        }
        // From the mesh to the collider: against the outward normals of the faces.
        let outward = one.0 + two.0;
        let normal = axis / square.sqrt();
        let normal = if normal.dot(&outward) > 0.0 { -normal } else { normal };
        if !edge.points_out(&(self.pose.rotation * normal)) {
            return None;
        }
        let cosine = one.0.dot(&two.0);
        // Between the normals of both faces.
        let along_faces = [normal.dot(&one.0), normal.dot(&two.0)];
        let is_between = || (0..2).all(|face| along_faces[face] - cosine * along_faces[1 - face] <= BETWEEN);
        if self.on_terrain && !is_between() {
            return None;
        }
        // A point on the intersection line of the two faces.
        let scale = 1.0 / (1.0 - cosine * cosine);
        let line = one.0 * ((one.1 - two.1 * cosine) * scale) + two.0 * ((two.1 - one.1 * cosine) * scale);
        let distance = normal.dot(&(line - ends[0]));
        // The point where the mesh's edge passes the line.
        let way = line - ends[0];
        let own = own.normalize();
        let cross = along.dot(&own);
        let at = (way.dot(&along) - way.dot(&own) * cross) / (1.0 - cross * cross);
        let place = ends[0] + along * at;
        let within = (0.0..=(ends[1] - ends[0]).norm()).contains(&at)
            && faces.planes().iter().all(|(n, h)| n.dot(&place) - h < self.margin.max(-distance) + 1e-6);
        within.then(|| (normal, place + normal * (0.5 * distance), distance))
    }
}

/// The side of the nearest triangle that a point is on.
struct Side {
    /// Squared distance \[m2\], and the height above the triangle relative to the distance.
    nearest: f64,
    height: f64,
    outside: bool,
}

impl Default for Side {
    fn default() -> Self {
        Self { nearest: f64::INFINITY, height: 0.0, outside: false }
    }
}

impl Side {
    fn look(&mut self, triangle: &SurfaceTriangle, place: &Point3<f64>) {
        let out = place - triangle.nearest(place);
        let (square, height) = (out.norm_squared(), triangle.normal.dot(&out));
        // If several triangles meet in the nearest point, the one that faces the point most decides.
        let same = (square - self.nearest).abs() <= 1e-9 * square;
        if square < self.nearest && !same || same && height.abs() > self.height.abs() {
            (self.nearest, self.height, self.outside) = (square, height, height > 0.0);
        }
    }
}

fn middle(triangle: &SurfaceTriangle) -> Point3<f64> {
    let [a, b, c] = triangle.corners.map(|corner| corner.coords);
    Point3::from((a + b + c) / 3.0)
}

/// Keeps a touched triangle: the nearest of triangles with nearly the same normal, and the nearest on a
/// ridge. In a valley all are kept.
fn keep(touches: &mut [Option<Touch>; MOST], touch: Touch) {
    let same = |other: &Touch| {
        let alike = other.normal.dot(&touch.normal) > ALIKE;
        let valley = other.normal.dot(&(touch.middle - other.corner)) > 1e-9
            && touch.normal.dot(&(other.middle - touch.corner)) > 1e-9;
        alike || !valley
    };
    let nearer =
        touches.iter().flatten().all(|other| !same(other) || touch.distance.abs() < other.distance.abs());
    if !nearer {
        return;
    }
    touches.iter_mut().for_each(|slot| *slot = slot.filter(|other| !same(other)));
    if let Some(free) = touches.iter_mut().find(|slot| slot.is_none()) {
        *free = Some(touch);
    }
}

/// Returns the nearest points of two segments, preceded by the position of the first as a fraction of its
/// segment.
fn nearest_of_segments(a: &[Point3<f64>; 2], b: &[Point3<f64>; 2]) -> (f64, [Point3<f64>; 2]) {
    let (u, v, between) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (ub, vb) = (u.dot(&between), v.dot(&between));
    let square = uu * vv - uv * uv;
    let mut s = if square > 1e-12 * uu * vv { ((uv * vb - ub * vv) / square).clamp(0.0, 1.0) } else { 0.5 };
    let mut t = if vv > 0.0 { (uv * s + vb) / vv } else { 0.0 };
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = if uu > 0.0 { ((uv * t - ub) / uu).clamp(0.0, 1.0) } else { 0.0 };
    }
    (s, [a[0] + u * s, b[0] + v * t])
}
