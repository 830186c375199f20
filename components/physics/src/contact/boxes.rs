//! Contact of two boxes: the axis of largest separation, and the faces clipped against each other.

use nalgebra::{IsometryMatrix3, Matrix3, Point3, Vector3};

/// The reference face is on the second box only if its face separates better by this distance \[m\].
/// Otherwise rounding would decide between two parallel faces.
const PREFERENCE: f64 = 1e-4;

/// Two edges touch if their axis separates better than every face by this distance \[m\].
const CROSSING: f64 = 1e-5;

/// Squared sine of the angle below which two edges count as parallel.
const PARALLEL: f64 = 1e-6;

/// Corners this far outside a face still count as inside it \[m\].
const WITHIN: f64 = 5e-5;

/// Smallest feature number of contacts between edges.
const EDGES: u32 = 1 << 30;

/// A corner of the clipped face.
#[derive(Clone, Copy)]
struct Corner {
    /// Position in the frame of the box with the reference face \[m\].
    at: Vector3<f64>,
    /// Feature number, which is stable for the same corner or the same crossing of an edge and a side.
    id: u32,
    /// The edge to the next corner: 0 to 3 are edges of the face, 4 to 7 are the clipping sides.
    edge: u32,
}

/// Capacity for a quadrilateral clipped by four sides.
const CORNERS: usize = 8;

/// The axis of largest separation of two boxes.
#[derive(Clone, Copy)]
enum Axis {
    /// Normal of a face of the first or second box: its axis and the sign that points to the other box.
    Face { second: bool, axis: usize, sign: f64 },
    /// Perpendicular to an edge of each box, from the first to the second, in the frame of the first.
    Edges { axes: [usize; 2], normal: Vector3<f64> },
}

/// Passes the contact points of two boxes (half extents and poses) closer than `margin` \[m\] to `found`: the
/// feature number, the point halfway between the surfaces, the normal from the second to the first, and the
/// distance. Returns a lower bound of the distance between the boxes \[m\], or the negative penetration depth
/// if they overlap.
pub(super) fn collide(
    (a, pose_a): (&Vector3<f64>, &IsometryMatrix3<f64>),
    (b, pose_b): (&Vector3<f64>, &IsometryMatrix3<f64>),
    margin: f64,
    mut found: impl FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) -> f64 {
    let (ra, rb) = (pose_a.rotation.matrix(), pose_b.rotation.matrix());
    // Pose of the second box in the frame of the first.
    let turn = ra.tr_mul(rb);
    let offset = ra.tr_mul(&(pose_b.translation.vector - pose_a.translation.vector));
    let (separation, axis) = separate(a, b, &turn, &offset);
    if separation > margin {
        return separation;
    }
    match axis {
        Axis::Edges { axes, normal } => {
            let (p, q) = edges(a, b, (&turn, &offset), axes, &normal);
            let middle = (p + q) * 0.5;
            let id = EDGES | (axes[0] * 3 + axes[1]) as u32;
            found(id | signs(&normal) << 4, pose_a * Point3::from(middle), -(ra * normal), separation);
        }
        Axis::Face { second, axis, sign } => {
            // The box with the reference face, and the other box in its frame.
            let (own, other, turn, offset) =
                if second { (b, a, turn.transpose(), -turn.tr_mul(&offset)) } else { (a, b, turn, offset) };
            let pose = if second { pose_b } else { pose_a };
            let face = u32::from(second) << 12 | (axis as u32) << 10 | u32::from(sign > 0.0) << 9;
            let mut normal = Vector3::zeros();
            normal[axis] = sign;
            let outward = pose.rotation * normal;
            let towards_first = if second { outward } else { -outward };
            clip(own, other, (&turn, &offset), (axis, sign), &mut |corner, height| {
                if height < margin {
                    let middle = corner.at - normal * (0.5 * height);
                    found(face | corner.id, pose * Point3::from(middle), towards_first, height);
                }
            });
        }
    }
    separation
}

/// Returns the octant number of a direction.
fn signs(direction: &Vector3<f64>) -> u32 {
    (0..3).map(|axis| u32::from(direction[axis] > 0.0) << axis).sum()
}

/// Returns the largest separation along the axes of both boxes and the cross products of their edges, with
/// its axis.
fn separate(a: &Vector3<f64>, b: &Vector3<f64>, turn: &Matrix3<f64>, offset: &Vector3<f64>) -> (f64, Axis) {
    let absolute = turn.abs();
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    let of_first = offset.abs() - a - absolute * b;
    let along = turn.tr_mul(offset);
    let of_second = along.abs() - b - absolute.tr_mul(a);
    let (first, second) = (of_first.imax(), of_second.imax());
    let mut best = (of_first[first], Axis::Face { second: false, axis: first, sign: sign(offset[first]) });
    if of_second[second] > best.0 + PREFERENCE {
        // From the second box to the first.
        best = (of_second[second], Axis::Face { second: true, axis: second, sign: -sign(along[second]) });
    }
    let least = of_first[first].max(of_second[second]) + CROSSING;
    let mut crossing: Option<(f64, Axis)> = None;
    for (i, (j, k)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
        for (u, (v, w)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            // Cross product of axis i of the first box and axis u of the second.
            let squared = turn[(j, u)] * turn[(j, u)] + turn[(k, u)] * turn[(k, u)];
            if squared < PARALLEL {
                continue;
            }
            let distance = turn[(j, u)] * offset[k] - turn[(k, u)] * offset[j];
            let reach = a[j] * absolute[(k, u)]
                + a[k] * absolute[(j, u)]
                + b[v] * absolute[(i, w)]
                + b[w] * absolute[(i, v)];
            let length = squared.sqrt();
            let separation = (distance.abs() - reach) / length;
            if separation > crossing.map_or(least, |(most, _)| most) {
                let mut normal = Vector3::zeros();
                let way = sign(distance) / length;
                (normal[j], normal[k]) = (-turn[(k, u)] * way, turn[(j, u)] * way);
                crossing = Some((separation, Axis::Edges { axes: [i, u], normal }));
            }
        }
    }
    crossing.unwrap_or(best)
}

/// Returns the nearest points of the touching edges, in the frame of the first box.
fn edges(
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    (turn, offset): (&Matrix3<f64>, &Vector3<f64>),
    [i, u]: [usize; 2],
    normal: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let mut p = a.zip_map(normal, |half, n| if n > 0.0 { half } else { -half });
    p[i] = 0.0;
    let inward = turn.tr_mul(normal);
    let mut q = b.zip_map(&inward, |half, n| if n > 0.0 { -half } else { half });
    q[u] = 0.0;
    let q = offset + turn * q;
    // Lines p + s e_i and q + t d.
    let d: Vector3<f64> = turn.column(u).into();
    let gap = q - p;
    let (across, along) = (d[i], gap.dot(&d));
    let s = (gap[i] - across * along) / (1.0 - across * across).max(f64::MIN_POSITIVE);
    let s = s.clamp(-a[i], a[i]);
    p[i] = s;
    let t = (p - q).dot(&d).clamp(-b[u], b[u]);
    (p, q + d * t)
}

/// Passes the corners of the incident face of `other`, clipped by the sides of the reference face, and their
/// heights above the reference face to `found`.
fn clip(
    own: &Vector3<f64>,
    other: &Vector3<f64>,
    (turn, offset): (&Matrix3<f64>, &Vector3<f64>),
    (axis, sign): (usize, f64),
    found: &mut dyn FnMut(Corner, f64),
) {
    // The face of the other box whose normal is most opposed to the reference normal.
    let against = turn.row(axis) * sign;
    let incident = against.iter().enumerate().max_by(|x, y| x.1.abs().total_cmp(&y.1.abs()));
    let incident = incident.map_or(0, |(index, _)| index);
    let outside = if against[incident] > 0.0 { -1.0 } else { 1.0 };
    let (v, w) = ((incident + 1) % 3, (incident + 2) % 3);
    let none = Corner { at: Vector3::zeros(), id: 0, edge: 0 };
    let (mut corners, mut next) = ([none; CORNERS], [none; CORNERS]);
    let mut count = 4;
    for (index, (x, y)) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().enumerate() {
        let mut at = Vector3::zeros();
        (at[incident], at[v], at[w]) = (outside * other[incident], x * other[v], y * other[w]);
        let face = 2 * incident as u32 + u32::from(outside > 0.0);
        corners[index] = Corner { at: offset + turn * at, id: face << 2 | index as u32, edge: index as u32 };
    }
    for side in 0..4 {
        let across = (axis + 1 + side / 2) % 3;
        let towards = if side % 2 == 0 { 1.0 } else { -1.0 };
        let beyond = |corner: &Corner| towards * corner.at[across] - own[across] - WITHIN;
        let mut kept = 0;
        for index in 0..count {
            let (here, there) = (corners[index], corners[(index + 1) % count]);
            let (from, to) = (beyond(&here), beyond(&there));
            if from <= 0.0 && kept < CORNERS {
                next[kept] = here;
                kept += 1;
            }
            if (from <= 0.0) != (to <= 0.0) && kept < CORNERS {
                let share = ((from + WITHIN) / (from - to)).clamp(0.0, 1.0);
                let at = here.at + (there.at - here.at) * share;
                // Where the edge leaves the face, the next edge is the clipping side. These numbers are above
                // the numbers of whole corners.
                let edge = if from <= 0.0 { 4 + side as u32 } else { here.edge };
                next[kept] = Corner { at, id: 32 | here.edge << 2 | side as u32, edge };
                kept += 1;
            }
        }
        count = kept;
        core::mem::swap(&mut corners, &mut next);
        if count == 0 {
            return;
        }
    }
    for corner in &corners[..count] {
        found(*corner, sign * corner.at[axis] - own[axis]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Translation3};

    fn pose(position: [f64; 3], rpy: [f64; 3]) -> IsometryMatrix3<f64> {
        let rotation = Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        IsometryMatrix3::from_parts(Translation3::from(position), rotation)
    }

    type Points = Vec<(u32, Point3<f64>, Vector3<f64>, f64)>;

    fn points(a: ([f64; 3], IsometryMatrix3<f64>), b: ([f64; 3], IsometryMatrix3<f64>)) -> (f64, Points) {
        let mut points = Vec::new();
        let (first, second) = (Vector3::from(a.0), Vector3::from(b.0));
        let least = collide((&first, &a.1), (&second, &b.1), 0.01, |id, p, n, d| points.push((id, p, n, d)));
        (least, points)
    }

    #[test]
    fn box_on_a_box_touches_at_the_smaller_face() {
        let turned = pose([0.02, 0.01, 0.149], [0.0, 0.0, 0.3]);
        let (least, found) = points(([0.05; 3], turned), ([0.2, 0.2, 0.1], pose([0.0; 3], [0.0; 3])));
        assert!((least + 1e-3).abs() < 1e-12, "{least}");
        assert_eq!(found.len(), 4);
        for (_, point, normal, distance) in &found {
            assert!((normal - Vector3::z()).norm() < 1e-12 && (distance + 1e-3).abs() < 1e-12);
            assert!((point.z - 0.0995).abs() < 1e-12);
            let corner = turned.inverse_transform_point(point);
            assert!((corner.x.abs() - 0.05).abs() < 1e-12 && (corner.y.abs() - 0.05).abs() < 1e-12);
        }
    }

    #[test]
    fn crossed_planks_touch_at_their_common_patch() {
        let long = [0.5, 0.05, 0.02];
        let crosswise = pose([0.0, 0.0, 0.04], [0.0, 0.0, core::f64::consts::FRAC_PI_2]);
        let (_, found) = points((long, crosswise), (long, pose([0.0; 3], [0.0; 3])));
        assert_eq!(found.len(), 4);
        for (_, point, normal, distance) in &found {
            assert!((point.x.abs() - 0.05).abs() < 1e-4 && (point.y.abs() - 0.05).abs() < 1e-4, "{point}");
            assert!((normal - Vector3::z()).norm() < 1e-12 && distance.abs() < 1e-12);
        }
        let ids: std::collections::BTreeSet<_> = found.iter().map(|(id, ..)| id).collect();
        assert_eq!(ids.len(), 4, "each with a distinct number");
    }

    #[test]
    fn crossing_edges_touch_at_one_point() {
        // Both touch with an edge: the upper one along y, the lower one along x.
        let high = pose([0.03, 0.02, 0.1 * 2.0_f64.sqrt() - 1e-3], [0.0, core::f64::consts::FRAC_PI_4, 0.0]);
        let low = pose([0.0; 3], [core::f64::consts::FRAC_PI_4, 0.0, 0.0]);
        let (least, found) = points(([0.05; 3], high), ([0.05; 3], low));
        assert_eq!(found.len(), 1);
        let (_, point, normal, distance) = found[0];
        assert!((distance + 1e-3).abs() < 1e-12 && (least + 1e-3).abs() < 1e-12);
        assert!((normal - Vector3::z()).norm() < 1e-12);
        let crossing = Point3::new(0.03, 0.0, 0.05 * 2.0_f64.sqrt() - 0.5e-3);
        assert!((point - crossing).norm() < 1e-12, "{point}");
    }

    #[test]
    fn the_bound_is_a_lower_bound_in_both_orders() {
        for index in 1..400 {
            let phase = f64::from(index);
            let wave = |rate: f64| (rate * phase).sin();
            let half = ([0.05, 0.08, 0.03], [0.1, 0.02, 0.06]);
            let first = pose([0.0; 3], [wave(1.1) * 3.0, wave(2.3), wave(0.7) * 3.0]);
            let away =
                Vector3::new(wave(3.1), wave(1.7), wave(2.9)).normalize() * (0.05 + 0.2 * wave(0.37).abs());
            let second = pose(away.into(), [wave(0.9) * 3.0, wave(1.3), wave(1.9) * 3.0]);
            let (least, found) = points((half.0, first), (half.1, second));
            let (swapped, _) = points((half.1, second), (half.0, first));
            // The choice of the reference box may depend on the preference.
            assert!((least - swapped).abs() < PREFERENCE + 1e-12, "{index}: {least} {swapped}");
            // Estimate the distance from samples on the surface of one box against the other.
            let mut distance = f64::INFINITY;
            for sample in 0..4000 {
                let at = f64::from(sample);
                let mut point =
                    Vector3::new((1.7 * at).sin(), (2.3 * at + 1.0).sin(), (3.1 * at + 2.0).sin());
                point /= point.amax();
                let point = second * Point3::from(point.component_mul(&Vector3::from(half.1)));
                let inside = first.inverse_transform_point(&point).coords.abs() - Vector3::from(half.0);
                distance = distance.min(inside.sup(&Vector3::zeros()).norm());
            }
            assert!(least <= distance + 1e-9, "{index}: {least} m, {distance} m");
            for (_, point, normal, depth) in found {
                // Each point is halfway between the surfaces: half the distance along the normal leads to the
                // second surface.
                let on_second = second.inverse_transform_point(&(point - normal * (0.5 * depth)));
                let beyond = on_second.coords.abs() - Vector3::from(half.1);
                assert!(beyond.max() < 1.1 * WITHIN, "{index}: {beyond}");
            }
        }
    }
}
