//! The contact points of one pair of colliders.

use std::cell::Cell;

use motorium_robots::{CollisionModel, Collisions, ConvexShape};
use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::boxes;
use super::colliders::Collider;
use super::features::{ContactGeometry, Feature};
use super::pair::{AHEAD, Pair};
use super::patch;
use super::surfaces;

/// The nearest points of a pair are a separate contact point if they are closer than all features by this
/// distance \[m\].
const MISSED: f64 = 1e-4;

/// Feature number of the nearest points of a pair.
const NEAREST: u32 = u32::MAX >> 1;

/// Passes the contact points of a pair closer than `margin` \[m\] to `found`: true if the surface is on the
/// first collider, the feature number, the point, the normal and the distance. Returns a lower bound of the
/// distance of the pair \[m\].
///
/// A mesh touches by its [triangles](surfaces). Two boxes touch at the corners of their faces
/// [clipped](boxes) against each other. Other shapes that touch in a line or a face do so at the corners of
/// their [patch]. For the rest, the points are the [features](ContactGeometry::features) of each collider
/// near the surface of the other. If these miss the contact, as between crossing edges or on a hull, the
/// nearest points of the two are used.
pub(super) fn measure(
    model: &CollisionModel,
    pair: &Pair,
    [first, second]: [&Collider; 2],
    distances: &mut Collisions,
    margin: f64,
    found: &mut dyn FnMut(bool, u32, Point3<f64>, Vector3<f64>, f64),
) -> f64 {
    if pair.half_space {
        let (a, b) = (&distances.pose(pair.first), &distances.pose(pair.second));
        // The features of every shape include the lowest point.
        let mut least = f64::INFINITY;
        search((first, a), (second, b), f64::INFINITY, |feature, point, normal, distance| {
            least = least.min(distance);
            if distance < margin {
                found(false, feature, point, normal, distance);
            }
        });
        return least;
    }
    let gap = distances.position(pair.first) - distances.position(pair.second);
    let gap = gap.norm() - pair.reach;
    if gap > margin + AHEAD {
        return gap;
    }
    for (mover, other, second_moves) in [(first, second, false), (second, first, true)] {
        let Some(surface) = &other.surface else { continue };
        let places = [pair.first, pair.second].map(|index| distances.pose(index));
        let [moving, standing] = if second_moves { [1, 0] } else { [0, 1] };
        let mut found =
            |feature, point, normal, distance| found(second_moves, feature, point, normal, distance);
        return surfaces::collide((mover, &places[moving]), (surface, &places[standing]), margin, &mut found);
    }
    if let (ConvexShape::Box { half: one }, ConvexShape::Box { half: two }) = (&first.shape, &second.shape) {
        let (a, b) = (&distances.pose(pair.first), &distances.pose(pair.second));
        return boxes::collide((one, a), (two, b), margin, |feature, point, normal, distance| {
            found(false, feature, point, normal, distance);
        });
    }
    let Some(nearest) = distances.distance_within(model, pair.index, margin + AHEAD) else {
        return margin + AHEAD;
    };
    if nearest.distance > margin {
        return nearest.distance;
    }
    let (a, b) = (&distances.pose(pair.first), &distances.pose(pair.second));
    let least = Cell::new(margin);
    let mut found = |swapped: bool, feature: u32, point, normal, distance| {
        least.set(least.get().min(distance));
        found(swapped, feature, point, normal, distance);
    };
    // Two colliders that touch in a line or a face.
    let mut patch = |swapped: bool, feature, point, normal, distance: f64| {
        if distance < margin {
            found(!swapped, feature, point, normal, distance);
        }
    };
    let apart = (&nearest.normal.into_inner(), nearest.distance);
    if patch::collide([(first, a), (second, b)], apart, margin, &mut patch) {
        return nearest.distance;
    }
    // A sphere has a single feature, which finds every contact.
    let round = |collider: &Collider| matches!(collider.shape, ConvexShape::Sphere { .. });
    if !round(second) || round(first) {
        search((first, a), (second, b), margin, |f, p, n, d| found(false, f, p, n, d));
    }
    if !round(first) {
        search((second, b), (first, a), margin, |f, p, n, d| found(true, f, p, n, d));
    }
    if nearest.distance < least.get() - MISSED {
        let [p, q] = nearest.points;
        let point = nalgebra::center(&p, &q);
        found(false, NEAREST, point, -nearest.normal.into_inner(), nearest.distance);
    }
    nearest.distance
}

/// Finds the features of `from` near the surface of `onto`.
fn search(
    (from, from_pose): (&Collider, &IsometryMatrix3<f64>),
    (onto, onto_pose): (&Collider, &IsometryMatrix3<f64>),
    margin: f64,
    mut found: impl FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) {
    let relative = onto_pose.inv_mul(from_pose);
    let Some(away) = onto.away(&relative.translation.vector) else { return };
    let towards = relative.rotation.inverse_transform_vector(&-away);
    from.shape.features(&towards, &mut |Feature { index, point, radius }| {
        let place = relative * Point3::from(point);
        let Some((height, normal)) = onto.surface_towards(&place.coords, &away) else { return };
        let distance = height - radius;
        if distance < margin {
            let middle = place - normal * (radius + 0.5 * distance);
            found(index, onto_pose * middle, onto_pose * normal, distance);
        }
    });
}
