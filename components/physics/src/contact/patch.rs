//! Contact patches: a face of one collider clipped against a face, an edge or a side line of the other.
//!
//! [Features](super::features) find every contact in which the end of a line or the corner of a face is above
//! the other collider. If both ends are beyond it, as with a rod on a narrow pad, they find at most one
//! point. A patch has the points where lines and faces leave each other, so it can transmit moments.

use motorium_robots::ConvexShape;
use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::colliders::Collider;
use super::outermost::{DENSE, outermost_face};

/// Number of corners of a disc.
const DISC: usize = 8;

/// Largest number of corners of a face.
const MOST: usize = 16;

/// Largest number of corners of a face clipped by another.
const CLIPPED: usize = 2 * MOST;

/// Number of patch corners that become contact points. More would add no support and slow down the
/// convergence of a solver.
const KEPT: usize = 4;

/// Largest sine of the tilt of a face or a line against the contact plane.
const TILT: f64 = 0.02;

/// A face normal is used as the contact normal if its separation is at most this much smaller than the
/// distance of the colliders \[m\].
const SEPARATION: f64 = 2e-5;

/// Corners this far outside a face still count as inside it \[m\].
const WITHIN: f64 = 5e-5;

/// Smallest feature number of patch points.
const PATCH: u32 = 1 << 30;

/// A flat or straight part of a surface, world axes.
struct Part {
    points: [Vector3<f64>; MOST],
    count: usize,
    /// Distance of the surface from the points \[m\].
    radius: f64,
    /// Outward normal of a face.
    normal: Option<Vector3<f64>>,
    /// True for a disc, whose rim is approximated by the points.
    disc: bool,
}

/// A corner of the clipped part.
#[derive(Clone, Copy)]
struct Corner {
    at: Vector3<f64>,
    /// Feature number, which is stable for the same corner or the same crossing of an edge and a side.
    id: u32,
    /// The edge to the next corner: an edge of the part, or of the face from [`MOST`] on.
    edge: u32,
}

/// Passes the points of the patch of two colliders to `found`. Each has a flag that is true if the face is on
/// the second collider, the number of the point, the point halfway between the surfaces, the normal towards
/// the collider without the face, and the distance.
///
/// `normal` points from the first to the second, and `distance` \[m\] is the distance between them. Returns
/// `false` and passes nothing if they do not touch in a line or a face.
pub(super) fn collide(
    [(first, a), (second, b)]: [(&Collider, &IsometryMatrix3<f64>); 2],
    (normal, distance): (&Vector3<f64>, f64),
    margin: f64,
    found: &mut dyn FnMut(bool, u32, Point3<f64>, Vector3<f64>, f64),
) -> bool {
    let faces = [face(first, a, normal), face(second, b, &-normal)];
    // Faces with straight sides come before discs, whose corners are on their rim.
    let order = if faces[0].as_ref().is_some_and(|face| face.disc) { [1, 0] } else { [0, 1] };
    for place in order {
        let (Some(face), other) = (&faces[place], [(second, b), (first, a)][place]) else { continue };
        let Some(outward) = face.normal else { continue };
        let support = lowest(other, &outward) - outward.dot(&face.points[0]);
        if support < distance - SEPARATION {
            continue;
        }
        let Some(part) = part(other, &-outward) else { continue };
        if clip(face, &outward, &part, margin, &mut |id, point, gap| {
            found(place == 1, PATCH | (place as u32) << 12 | id, point, outward, gap);
        }) {
            return true;
        }
    }
    let lines = [part((first, a), normal), part((second, b), &-normal)];
    if let [Some(one), Some(other)] = &lines {
        return parallel(one, other, distance, &mut |id, point, out, gap| {
            found(true, PATCH | 1 << 13 | id, point, out, gap);
        });
    }
    false
}

/// Returns the height along `up` of the lowest point of a collider.
fn lowest((collider, pose): (&Collider, &IsometryMatrix3<f64>), up: &Vector3<f64>) -> f64 {
    let local = pose.rotation.inverse_transform_vector(up);
    let depth = match &collider.shape {
        ConvexShape::Sphere { radius } => *radius,
        ConvexShape::Box { half } => half.dot(&local.abs()),
        ConvexShape::Cylinder { radius, half_length } => {
            radius * local.x.hypot(local.y) + half_length * local.z.abs()
        }
        ConvexShape::Capsule { radius, half_length } => radius + half_length * local.z.abs(),
        ConvexShape::Hull { points } => {
            -points.iter().map(|point| point.dot(&local)).fold(f64::MAX, f64::min)
        }
        ConvexShape::HalfSpace => f64::INFINITY,
    };
    pose.translation.vector.dot(up) - depth
}

impl Part {
    fn new(radius: f64, normal: Option<Vector3<f64>>) -> Self {
        Self { points: [Vector3::zeros(); MOST], count: 0, radius, normal, disc: false }
    }

    fn push(&mut self, point: Vector3<f64>) {
        if self.count < MOST {
            self.points[self.count] = point;
            self.count += 1;
        }
    }

    fn points(&self) -> &[Vector3<f64>] {
        &self.points[..self.count]
    }

    fn placed(mut self, pose: &IsometryMatrix3<f64>) -> Self {
        for point in &mut self.points[..self.count] {
            *point = pose.rotation * *point + pose.translation.vector;
        }
        self.normal = self.normal.map(|normal| pose.rotation * normal);
        self
    }
}

/// Returns the face of a collider that faces a direction best; `None` if the collider is round or has a
/// corner there.
fn face(collider: &Collider, pose: &IsometryMatrix3<f64>, towards: &Vector3<f64>) -> Option<Part> {
    let local = pose.rotation.inverse_transform_vector(towards);
    let face = match &collider.shape {
        ConvexShape::Box { half } => {
            let axis = local.iamax();
            box_face(half, axis, local[axis])
        }
        ConvexShape::Cylinder { radius, half_length } if local.z.abs() > 0.7 => {
            disc(*radius, *half_length, &local)
        }
        ConvexShape::Hull { points } => hull(points, &local, collider.shape.bounding_radius())?,
        _ => return None,
    };
    face.normal.is_some().then(|| face.placed(pose))
}

/// Returns the face, edge or side line of a collider that is nearly perpendicular to a direction.
fn part((collider, pose): (&Collider, &IsometryMatrix3<f64>), towards: &Vector3<f64>) -> Option<Part> {
    let local = pose.rotation.inverse_transform_vector(towards);
    let line = |radius: f64, half_length: f64| {
        let mut line = Part::new(radius, None);
        line.push(Vector3::new(0.0, 0.0, -half_length));
        line.push(Vector3::new(0.0, 0.0, half_length));
        line
    };
    let part = match &collider.shape {
        ConvexShape::Box { half } => {
            let axis = local.iamax();
            let along = local.iamin();
            if 1.0 - local[axis].abs() < 0.5 * TILT * TILT {
                box_face(half, axis, local[axis])
            } else if local[along].abs() < TILT {
                let mut edge = Part::new(0.0, None);
                for end in [-1.0, 1.0] {
                    let mut corner = half.zip_map(&local, |half, towards| half * towards.signum());
                    corner[along] = end * half[along];
                    edge.push(corner);
                }
                edge
            } else {
                return None;
            }
        }
        ConvexShape::Cylinder { radius, half_length } if local.z.abs() < TILT => line(*radius, *half_length),
        ConvexShape::Cylinder { radius, half_length } if local.x.hypot(local.y) < TILT => {
            disc(*radius, *half_length, &local)
        }
        ConvexShape::Capsule { radius, half_length } if local.z.abs() < TILT => line(*radius, *half_length),
        ConvexShape::Hull { points } => hull(points, &local, collider.shape.bounding_radius())?,
        _ => return None,
    };
    Some(part.placed(pose))
}

fn box_face(half: &Vector3<f64>, axis: usize, sign: f64) -> Part {
    let (v, w) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut normal = Vector3::zeros();
    normal[axis] = sign.signum();
    let mut face = Part::new(0.0, Some(normal));
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let mut corner = Vector3::zeros();
        (corner[axis], corner[v], corner[w]) = (sign.signum() * half[axis], x * half[v], y * half[w]);
        face.push(corner);
    }
    face
}

/// Returns the end of a cylinder. The deepest point of its rim is one of the corners, unless the disc lies
/// flat.
fn disc(radius: f64, half_length: f64, towards: &Vector3<f64>) -> Part {
    let end = towards.z.signum();
    let mut face = Part { disc: true, ..Part::new(0.0, Some(Vector3::new(0.0, 0.0, end))) };
    let start = if towards.x.hypot(towards.y) > 1e-4 { towards.y.atan2(towards.x) } else { 0.0 };
    for corner in 0..DISC {
        let (sin, cos) = (start + core::f64::consts::TAU * corner as f64 / DISC as f64).sin_cos();
        face.push(Vector3::new(radius * cos, radius * sin, end * half_length));
    }
    face
}

/// Returns the outermost corners of a hull in a direction, in their order around it: a face if three or more
/// are in one plane.
fn hull(points: &[Vector3<f64>], towards: &Vector3<f64>, size: f64) -> Option<Part> {
    let highest = points.iter().map(|point| point.dot(towards)).fold(f64::MIN, f64::max);
    let mut part = Part::new(0.0, None);
    let near = |point: &&Vector3<f64>| point.dot(towards) > highest - TILT * size;
    if points.len() > DENSE && points.iter().filter(near).nth(MOST).is_some() {
        let mut chosen = [0; MOST];
        let count = outermost_face(points, towards, size, &mut chosen);
        chosen[..count].iter().for_each(|index| part.push(points[*index as usize]));
    } else {
        for point in points.iter().filter(near) {
            if part.count == MOST {
                return None;
            }
            part.push(*point);
        }
    }
    if part.count < 3 {
        return (part.count == 2).then_some(part);
    }
    let centre = part.points().iter().sum::<Vector3<f64>>() / part.count as f64;
    let one = towards.cross(&if towards.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() }).normalize();
    let other = towards.cross(&one);
    let angle = |point: &Vector3<f64>| {
        let arm = point - centre;
        arm.dot(&other).atan2(arm.dot(&one))
    };
    part.points[..part.count].sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    // Twice the area as a vector: the normal of the best-fitting plane.
    let next = |index: usize| part.points[(index + 1) % part.count];
    let sum =
        |sum: Vector3<f64>, index: usize| sum + (part.points[index] - centre).cross(&(next(index) - centre));
    let normal = (0..part.count).fold(Vector3::zeros(), sum).try_normalize(1e-9 * size * size)?;
    let flat = part.points().iter().all(|point| (point - centre).dot(&normal).abs() < 1e-4 * size);
    part.normal = (flat && normal.dot(towards) > 0.0).then_some(normal);
    Some(part)
}

/// Clips a part by the sides of a face with this outward normal, and passes points closer than `margin` \[m\]
/// to `found`. Returns `false` and passes nothing if fewer than two points remain.
fn clip(
    face: &Part,
    outward: &Vector3<f64>,
    part: &Part,
    margin: f64,
    found: &mut dyn FnMut(u32, Point3<f64>, f64),
) -> bool {
    let none = Corner { at: Vector3::zeros(), id: 0, edge: 0 };
    let (mut corners, mut next) = ([none; CLIPPED], [none; CLIPPED]);
    for (index, point) in part.points().iter().enumerate() {
        corners[index] = Corner { at: *point, id: index as u32, edge: index as u32 };
    }
    let mut count = part.count;
    let straight = count == 2;
    for side in 0..face.count {
        let (from, to) = (face.points[side], face.points[(side + 1) % face.count]);
        // Corners are ordered counterclockwise or clockwise about the outward direction of the face.
        let across = (to - from).cross(outward);
        let middle = face.points().iter().sum::<Vector3<f64>>() / face.count as f64;
        let Some(across) = across.try_normalize(1e-12) else { continue };
        let across = if across.dot(&(from - middle)) < 0.0 { -across } else { across };
        let beyond = |corner: &Corner| across.dot(&(corner.at - from)) - WITHIN;
        let mut kept = 0;
        let edges = if straight { 1 } else { count };
        for index in 0..count {
            let (here, there) = (corners[index], corners[(index + 1) % count]);
            let (out, out_there) = (beyond(&here), beyond(&there));
            if out <= 0.0 && kept < CLIPPED {
                next[kept] = here;
                kept += 1;
            }
            if index < edges && (out <= 0.0) != (out_there <= 0.0) && kept < CLIPPED {
                let share = ((out + WITHIN) / (out - out_there)).clamp(0.0, 1.0);
                let at = here.at + (there.at - here.at) * share;
                let edge = if out <= 0.0 { (MOST + side) as u32 } else { here.edge };
                next[kept] = Corner { at, id: 32 | here.edge << 6 | side as u32, edge };
                kept += 1;
            }
        }
        count = kept;
        core::mem::swap(&mut corners, &mut next);
        if count < 2 {
            return false;
        }
    }
    let gap = |corner: &Corner| outward.dot(&(corner.at - face.points[0])) - part.radius;
    let kept = if count > KEPT { spread(&corners[..count], outward, gap) } else { [0, 1, 2, 3] };
    for (place, index) in kept.iter().enumerate() {
        if *index >= count || kept[..place].contains(index) {
            continue;
        }
        let corner = &corners[*index];
        let gap = gap(corner);
        if gap < margin {
            let middle = corner.at - outward * (part.radius + 0.5 * gap);
            found(corner.id, Point3::from(middle), gap);
        }
    }
    true
}

/// Selects four corners that transmit nearly the same moments as all: the deepest, and the ones that span the
/// largest area with it. A corner replaces an earlier one only if it is better by more than rounding, so the
/// choice is stable from step to step.
fn spread(corners: &[Corner], outward: &Vector3<f64>, gap: impl Fn(&Corner) -> f64) -> [usize; KEPT] {
    let best = |value: &dyn Fn(&Corner) -> f64, least: f64| {
        let mut best = (0, value(&corners[0]));
        for (index, corner) in corners.iter().enumerate().skip(1) {
            let value = value(corner);
            if value > best.1 + least {
                best = (index, value);
            }
        }
        best.0
    };
    let first = best(&|corner| -gap(corner), 1e-6);
    let start = corners[first].at;
    let second = best(&|corner| (corner.at - start).norm(), 1e-6);
    let across = (corners[second].at - start).cross(outward).normalize();
    let third = best(&|corner| across.dot(&(corner.at - start)), 1e-6);
    let fourth = best(&|corner| -across.dot(&(corner.at - start)), 1e-6);
    [first, second, third, fourth]
}

/// Passes the ends of the overlap of two parallel lines to `found`. Returns `false` and passes nothing if
/// they do not overlap.
fn parallel(
    one: &Part,
    other: &Part,
    distance: f64,
    found: &mut dyn FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) -> bool {
    if one.count != 2 || other.count != 2 {
        return false;
    }
    let (start, way) = (one.points[0], one.points[1] - one.points[0]);
    let (length, across) = (way.norm(), other.points[1] - other.points[0]);
    let along = way / length;
    if along.cross(&across).norm() > TILT * across.norm() {
        return false;
    }
    let ends = other.points().iter().map(|point| along.dot(&(point - start)));
    let (low, high) = ends.fold((f64::MAX, f64::MIN), |(low, high), end| (low.min(end), high.max(end)));
    let (low, high) = (low.max(0.0), high.min(length));
    if high - low < WITHIN {
        return false;
    }
    let slope = across.dot(&along);
    let points = [low, high].map(|at| {
        let here = start + along * at;
        let there = other.points[0] + across * (along.dot(&(here - other.points[0])) / slope);
        (here, there)
    });
    let gaps = points.map(|(here, there)| (here - there).norm() - one.radius - other.radius);
    // Lines without a radius, and lines that have passed each other, do not define a direction between them.
    if gaps[0].min(gaps[1]) > distance + SEPARATION || one.radius + other.radius < 1e-6 {
        return false;
    }
    for (end, ((here, there), gap)) in points.into_iter().zip(gaps).enumerate() {
        let out = (here - there).normalize();
        found(end as u32, Point3::from(there + out * (other.radius + 0.5 * gap)), out, gap);
    }
    true
}
