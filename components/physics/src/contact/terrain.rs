//! Contact points with the terrain.
//!
//! A round feature touches the faces below its centre. It also touches edges and corners that are nearer to
//! it than the faces around them. A sharp feature touches the face below it and, in a valley, the faces
//! beside it. If a box, a cylinder, a capsule or the hull of an object lies across a peak or a ridge, it
//! touches the peak, or the part of the ridge below it. Sides between coplanar faces are not edges.

use motorium_robots::{Collisions, ConvexShape, SurfaceEdge};
use motorium_worlds::{HeightField, NearTriangle};
use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::bounds::Motions;
use super::colliders::{Collider, Colliders, Owner};
use super::features::{ContactGeometry, Feature};
use super::normals::Normals;
use super::point::{ContactPoint, Motion, UNKNOWN};
use super::surface::SurfaceLaw;
use super::surfaces::Mover;

/// Largest number of points of one feature: no more faces meet at a corner of the grid.
const FACES: usize = 6;

/// Faces whose normals differ by less than 18 degrees touch as one: the cosine of 18 degrees.
const ALIKE: f64 = 0.95;

/// Deviation from 1 of the cosine between the normal of a face and the direction from the surface to a
/// feature, below which the feature is over the face.
const OVER: f64 = 1e-9;

/// Largest number of triangles near a round feature whose edges are all tested. If there are more, only the
/// nearest edge is used.
const MOST_NEAR: usize = 32;

/// Distances that differ by less than this count as equal \[m\].
const LEVEL: f64 = 1e-9;

/// Key bit of contacts with the terrain.
const TERRAIN: u64 = 1 << 63;

/// Key bits of contacts with ridges, and of sharp features in valleys.
const RIDGES: u64 = 1 << 34;
const VALLEYS: u64 = 1 << 35;

/// Up to this height above the ground, relative to the margin, a sharp feature may be closer than the margin
/// to the faces beside it.
const STEEP: f64 = 4.0;

/// A touching point of a feature.
#[derive(Clone, Copy)]
struct Touch {
    triangle: u32,
    /// Distance between the surfaces \[m\].
    distance: f64,
    normal: Vector3<f64>,
}

/// Passes the contact points of all moving colliders with the terrain to `found`. `margin` returns the margin
/// \[m\] for a speed \[m/s\].
pub(super) fn detect(
    (all, moving): (&Colliders, &[Motion]),
    distances: &Collisions,
    motions: &Motions,
    margin: impl Fn(f64, Owner) -> f64,
    found: &mut dyn FnMut(ContactPoint),
) {
    let Some(field) = &all.terrain else { return };
    let terrain = all.colliders.len() - 1;
    for (index, collider) in all.colliders[..terrain].iter().enumerate() {
        if moving[index] != Motion::Moves {
            continue;
        }
        let pose = distances.pose(index);
        let (speed, reach) = (motions.speed(index), collider.shape.bounding_radius());
        let (margin, centre) = (margin(speed, collider.owner), pose.translation.vector);
        let near = reach + margin;
        if centre.z - near > field.highest_near(centre.x, centre.y, near) {
            continue;
        }
        let point = |key: u64, first: usize, second: usize, point, normal, distance| {
            let (a, b) = (&all.colliders[first], &all.colliders[second]);
            ContactPoint {
                key: TERRAIN | (index as u64) << 36 | key,
                colliders: (first, second),
                owners: (a.owner, b.owner),
                point,
                normal,
                distance,
                speed,
                law: SurfaceLaw::between([a, b], |place| distances.pose([first, second][place]).rotation),
                held: None,
                h: UNKNOWN,
                kept: false,
            }
        };
        features(field, (collider, &pose), near, &mut |feature, takes| {
            let place = pose * Point3::from(feature.point);
            let touches = touches(field, &place, feature.radius, margin);
            let several = touches.iter().flatten().nth(1).is_some();
            for touch in touches.into_iter().flatten() {
                let Touch { triangle, distance, normal } = touch;
                if !takes(&normal) {
                    continue;
                }
                // A sharp feature touches one face, except in a valley; a round one has a small number.
                let (number, triangle) = (feature.index, u64::from(triangle & 0x00ff_ffff));
                let key = if feature.radius > 0.0 {
                    u64::from(number & 0x7f) << 24 | triangle
                } else if several {
                    VALLEYS | u64::from((number ^ number >> 6) & 0x3ff) << 24 | triangle
                } else {
                    u64::from(number)
                };
                let middle = place - normal * (feature.radius + 0.5 * distance);
                found(point(key, index, terrain, middle, normal, distance));
            }
        });
        let faceless = matches!(collider.shape, ConvexShape::Hull { .. }) && collider.faces.is_empty();
        if faceless || matches!(collider.shape, ConvexShape::Sphere { .. }) {
            continue;
        }
        let down = towards(&pose);
        field.visit_peaks(centre.x, centre.y, near, &mut |number, peak| {
            if peak.z < centre.z - near {
                return;
            }
            let local = pose.inverse_transform_point(&peak);
            let Some((distance, normal)) = collider.surface_towards(&local.coords, &down) else {
                return;
            };
            if distance < margin {
                let normal = pose.rotation * normal;
                let key = 1 << 31 | u64::from(number & 0x7fff_ffff);
                found(point(key, terrain, index, peak - normal * (0.5 * distance), normal, distance));
            }
        });
        let mover = Mover { collider, pose, centre: centre.into(), margin, on_terrain: true };
        let lowest = centre.z - depth(&collider.shape, &pose) - margin;
        field.visit_ridges(centre.x, centre.y, near, &mut |number, ends, normals| {
            if ends[0].z.max(ends[1].z) < lowest {
                return;
            }
            mover.edge(&SurfaceEdge { ends, normals }, &mut |end, middle, normal, distance| {
                let key = RIDGES | u64::from(number) << 1 | u64::from(end);
                found(point(key, index, terrain, middle, normal, distance));
            });
        });
    }
}

/// Returns the distance of the lowest point of a shape below its origin \[m\], or an upper bound for a hull.
fn depth(shape: &ConvexShape, pose: &IsometryMatrix3<f64>) -> f64 {
    let down = pose.rotation.inverse_transform_vector(&Vector3::z()).abs();
    match shape {
        ConvexShape::Box { half } => half.dot(&down),
        ConvexShape::Cylinder { radius, half_length } => radius * down.xy().norm() + half_length * down.z,
        ConvexShape::Capsule { radius, half_length } => radius + half_length * down.z,
        shape => shape.bounding_radius(),
    }
}

/// A predicate that is true for the face normals that a feature applies to.
type Takes<'a> = dyn Fn(&Vector3<f64>) -> bool + 'a;

/// Passes the features of a collider that may touch to `visit`, each with the face normals it applies to. The
/// rims of a cylinder and the corners of a dense hull depend on the normal: the deepest points against a
/// normal touch the faces with that normal. Only faces within `reach` \[m\] of the collider's origin are
/// considered.
fn features(
    field: &HeightField,
    (collider, pose): (&Collider, &IsometryMatrix3<f64>),
    reach: f64,
    visit: &mut dyn FnMut(Feature, &Takes<'_>),
) {
    let mut normals = Normals::default();
    if collider.shape.turns_features() {
        let centre = Point3::from(pose.translation.vector);
        field.visit_near(&centre, reach, &mut |triangle| normals.add(&triangle.normal));
    }
    for (number, normal) in normals.all().iter().enumerate() {
        let towards = pose.rotation.inverse_transform_vector(&-normal);
        let takes = |found: &Vector3<f64>| normals.is(number, found);
        collider.shape.features(&towards, &mut |feature| {
            visit(Feature { index: Normals::feature(number, feature.index), ..feature }, &takes);
        });
    }
    if normals.all().is_empty() {
        collider.shape.features(&towards(pose), &mut |feature| visit(feature, &|_| true));
    }
}

/// Returns the downward direction in the axes of a collider.
fn towards(pose: &IsometryMatrix3<f64>) -> Vector3<f64> {
    pose.rotation.inverse_transform_vector(&-Vector3::z())
}

/// Returns the points where a feature touches the terrain, or is closer to it than `margin` \[m\].
fn touches(field: &HeightField, place: &Point3<f64>, radius: f64, margin: f64) -> [Option<Touch>; FACES] {
    let mut touches = [None; FACES];
    let above = place.z - field.height(place.x, place.y);
    if radius == 0.0 {
        return sharp(field, place, above, margin);
    }
    if above <= 0.0 {
        let normal = field.normal(place.x, place.y);
        let distance = above * normal.z - radius;
        if distance < margin {
            touches[0] = Some(Touch { triangle: 0, distance, normal });
        }
        return touches;
    }
    let mut beside = Beside::default();
    field.visit_near(place, radius + margin, &mut |triangle| {
        let out = place - triangle.nearest;
        let length = out.norm();
        let normal = if length > 1e-12 { out / length } else { triangle.normal };
        let over = 1.0 - normal.dot(&triangle.normal) < OVER;
        let touch = Touch { triangle: triangle.index, distance: length - radius, normal };
        if over {
            keep(&mut touches, touch);
        }
        beside.add(Near { touch, triangle, over });
    });
    beside.visit_edges(field, &mut |touch| keep(&mut touches, touch));
    touches
}

/// Returns the points where a sharp feature, `above` the ground \[m\], touches the terrain or is closer to it
/// than `margin` \[m\]. These are in the face below it, and in faces beside it whose planes are not above the
/// ground here; such faces rise on the other side of a valley. Without them, a corner in a valley would be
/// pushed back and forth between two faces and never rest.
fn sharp(field: &HeightField, place: &Point3<f64>, above: f64, margin: f64) -> [Option<Touch>; FACES] {
    let mut touches = [None; FACES];
    let below = field.normal(place.x, place.y);
    if above * below.z < margin {
        touches[0] = Some(Touch { triangle: 0, distance: above * below.z, normal: below });
    }
    if above > STEEP * margin {
        return touches;
    }
    let near = Point3::new(place.x, place.y, place.z - above.min(0.0));
    field.visit_near(&near, margin, &mut |triangle| {
        let normal = triangle.normal;
        let distance = normal.dot(&(place - triangle.nearest));
        let is_below = 1.0 - normal.dot(&below) < OVER;
        if is_below {
            // The index of the face below is known only here.
            if let Some(touch) = touches[0].as_mut().filter(|touch| touch.triangle == 0) {
                touch.triangle = triangle.index;
            }
        } else if distance < margin && distance >= (above - LEVEL) * normal.z {
            keep_distinct(&mut touches, Touch { triangle: triangle.index, distance, normal });
        }
    });
    touches
}

/// Adds the point of a face unless its plane already has one. If there is no room, it replaces the farthest
/// point if it is closer.
fn keep_distinct(touches: &mut [Option<Touch>; FACES], touch: Touch) {
    let same = |other: &Touch| 1.0 - other.normal.dot(&touch.normal) < OVER;
    if touches.iter().flatten().any(same) {
        return;
    }
    let distance = |index: &usize| touches[*index].map_or(f64::INFINITY, |other| other.distance);
    let farthest = (1..FACES).max_by(|a, b| distance(a).total_cmp(&distance(b)));
    if let Some(index) = farthest.filter(|index| touch.distance < distance(index)) {
        touches[index] = Some(touch);
    }
}

/// A triangle near a round feature.
#[derive(Clone, Copy)]
struct Near {
    touch: Touch,
    triangle: NearTriangle,
    /// True if the feature is over the triangle.
    over: bool,
}

/// The triangles near a round feature.
#[derive(Default)]
struct Beside {
    near: [Option<Near>; MOST_NEAR],
    count: usize,
    /// The nearest of all triangles.
    nearest: Option<Near>,
}

impl Beside {
    fn add(&mut self, near: Near) {
        if let Some(free) = self.near.get_mut(self.count) {
            *free = Some(near);
        }
        self.count += 1;
        // A face takes precedence over its own edge.
        let before = self
            .nearest
            .map_or(f64::INFINITY, |other| other.touch.distance - if other.over { 1e-12 } else { 0.0 });
        if near.touch.distance < before || near.over && near.touch.distance <= before {
            self.nearest = Some(near);
        }
    }

    /// Passes the edges and corners that the feature touches to `visit`: the ones nearer to it than
    /// everything around them.
    fn visit_edges(&self, field: &HeightField, visit: &mut dyn FnMut(Touch)) {
        if self.count > MOST_NEAR {
            // There are too many to test, so only the nearest is used.
            if let Some(Near { touch, over: false, .. }) = self.nearest {
                visit(touch);
            }
            return;
        }
        let all = || self.near.iter().flatten();
        for edge in all().filter(|near| !near.over) {
            let nearer = |near: &Near| {
                let distance = near.touch.distance;
                distance < edge.touch.distance - LEVEL || near.over && distance <= edge.touch.distance + LEVEL
            };
            let at = &edge.triangle.nearest;
            // Compare distances first, because few triangles are nearer.
            if !all().any(|near| nearer(near) && field.is_near(&near.triangle, at, LEVEL)) {
                visit(edge.touch);
            }
        }
    }
}

/// Adds a point. Of two points with nearly the same normal, the deeper one is kept. If there is no room, the
/// new point replaces the shallowest one if it is deeper.
fn keep(touches: &mut [Option<Touch>; FACES], touch: Touch) {
    let alike =
        touches.iter().position(|other| other.is_some_and(|other| other.normal.dot(&touch.normal) > ALIKE));
    let free = || touches.iter().position(Option::is_none);
    let depth = |index: &usize| touches[*index].map_or(f64::INFINITY, |other| other.distance);
    let shallowest = || (0..FACES).max_by(|a, b| depth(a).total_cmp(&depth(b)));
    let Some(index) = alike.or_else(free).or_else(shallowest) else { return };
    if touches[index].is_none_or(|other| touch.distance < other.distance) {
        touches[index] = Some(touch);
    }
}

/// Returns the smallest height of an articulation's features above the terrain below them \[m\], along z;
/// `None` without a terrain.
pub(super) fn clearance(all: &Colliders, articulation: usize, distances: &Collisions) -> Option<f64> {
    let field = all.terrain.as_ref()?;
    let robot = all
        .colliders
        .iter()
        .enumerate()
        .filter(|(_, collider): &(usize, &Collider)| collider.owner.articulation() == Some(articulation));
    let mut least = f64::INFINITY;
    for (index, collider) in robot {
        let pose = distances.pose(index);
        let centre = pose.translation.vector;
        // Rims of cylinders are deepest against the face below.
        let against = pose.rotation.inverse_transform_vector(&-field.normal(centre.x, centre.y));
        collider.shape.features(&against, &mut |Feature { point, radius, .. }| {
            let place = pose * Point3::from(point);
            let (height, normal) = (field.height(place.x, place.y), field.normal(place.x, place.y));
            // A sphere touches the plane of the face below next to its lowest point.
            least = least.min(place.z - height - radius / normal.z);
        });
    }
    Some(least)
}
