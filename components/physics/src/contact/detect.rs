//! Contact generation: the points where colliders touch, or soon may.

use std::cell::Cell;

use motorium_robots::{Collisions, ConvexShape};
use nalgebra::{Isometry3, Point3, Vector3};

use super::colliders::{Collider, Colliders, Owner};
use super::features::{ContactGeometry, Feature};

/// Contact points kept at once. Of more, the deepest.
const MOST: usize = 96;

/// A point where two surfaces touch, or soon may.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactPoint {
    /// The same number for the same features of the same two colliders.
    pub(crate) key: u64,
    /// Indices of the two colliders: the normal points from the second to the first.
    pub(crate) colliders: (usize, usize),
    pub(crate) owners: (Owner, Owner),
    /// In the world \[m\], halfway between the surfaces.
    pub(crate) point: Point3<f64>,
    /// Unit vector in the world.
    pub(crate) normal: Vector3<f64>,
    /// Between the surfaces \[m\], negative where they overlap.
    pub(crate) distance: f64,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    /// Index in the pairs of the collision model.
    index: usize,
    first: usize,
    second: usize,
    /// Origins farther apart than this are not near one another \[m\]; for a half-space, height of the origin above it.
    reach: f64,
    half_space: bool,
}

/// The nearest points of a pair are a contact point of their own when they are nearer than all features by this \[m\].
const MISSED: f64 = 1e-4;

/// Number of the nearest points among the features of a pair.
const NEAREST: u32 = u32::MAX >> 1;

/// A workspace that finds contact points. Nothing allocates after [`new`](Self::new).
///
/// The points of a pair are the [features](ContactGeometry::features) of each collider near the surface of the other.
/// If these miss the contact, as between edges that cross or on a hull, the nearest points of the two are used.
pub(crate) struct Detector {
    pairs: Vec<Pair>,
    poses: Vec<Isometry3<f64>>,
    points: Vec<ContactPoint>,
    distances: Collisions,
    /// The points are all that are closer than this as the colliders stand \[m\]; zero when that is not known.
    complete_within: f64,
}

impl Detector {
    /// For all pairs of the collision model. A half-space is the second of its pairs.
    pub(crate) fn new(Colliders { colliders, model, .. }: &Colliders) -> Self {
        let mut pairs: Vec<_> = model
            .pairs()
            .iter()
            .enumerate()
            .map(|(index, &[first, second])| {
                let half_space = colliders[second].shape == ConvexShape::HalfSpace;
                let (a, b) = (&colliders[first].shape, &colliders[second].shape);
                let reach = a.bounding_radius() + if half_space { 0.0 } else { b.bounding_radius() };
                Pair { index, first, second, reach, half_space }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| (pair.first, pair.second));
        let poses = colliders.iter().map(|collider| collider.placement).collect();
        let points = Vec::with_capacity(MOST);
        Self { pairs, poses, points, distances: Collisions::new(model), complete_within: 0.0 }
    }

    /// Largest number of contact points.
    pub(crate) fn capacity(&self) -> usize {
        MOST
    }

    /// The points found last.
    pub(crate) fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// Forgets the last step.
    pub(crate) fn forget(&mut self) {
        self.points.clear();
        self.distances.forget();
        self.complete_within = 0.0;
    }

    /// Places a collider of the world.
    pub(crate) fn set_pose(&mut self, collider: usize, pose: Isometry3<f64>) {
        self.poses[collider] = pose;
        self.distances.set_pose(collider, &pose);
        self.complete_within = 0.0;
    }

    /// Places all colliders whose owner moves; `pose` is that of an owner in the world.
    pub(crate) fn set_poses(&mut self, colliders: &[Collider], pose: impl Fn(Owner) -> Isometry3<f64>) {
        for (index, (collider, place)) in colliders.iter().zip(&mut self.poses).enumerate() {
            if collider.owner != Owner::World {
                *place = pose(collider.owner) * collider.placement;
                self.distances.set_pose(index, place);
            }
        }
        self.complete_within = 0.0;
    }

    /// Height of the lowest point of the robot \[m\]; infinite without colliders.
    pub(crate) fn lowest(&self, colliders: &[Collider]) -> f64 {
        let mut lowest = f64::INFINITY;
        for (collider, pose) in
            colliders.iter().zip(&self.poses).filter(|(collider, _)| collider.owner.is_robot())
        {
            let down = pose.rotation.inverse_transform_vector(&-Vector3::z());
            collider.shape.features(&down, &mut |feature| {
                lowest = lowest.min((pose * Point3::from(feature.point)).z - feature.radius);
            });
        }
        lowest
    }

    /// Finds all contact points closer than `margin` \[m\].
    pub(crate) fn detect(
        &mut self,
        Colliders { colliders, model, .. }: &Colliders,
        margin: f64,
    ) -> &[ContactPoint] {
        if margin <= self.complete_within {
            // Nothing has moved since a detection with a larger margin.
            self.points.retain(|point| point.distance < margin);
            self.complete_within = margin;
            return &self.points;
        }
        let Self { pairs, poses, points, distances, .. } = self;
        points.clear();
        for (index, pair) in pairs.iter().enumerate() {
            let (a, b) = (&poses[pair.first], &poses[pair.second]);
            let far = if pair.half_space {
                let up = b.rotation * Vector3::z();
                (a.translation.vector - b.translation.vector).dot(&up) > pair.reach + margin
            } else {
                let apart = a.translation.vector - b.translation.vector;
                apart.norm_squared() > (pair.reach + margin).powi(2)
            };
            if far {
                continue;
            }
            let (first, second) = (&colliders[pair.first], &colliders[pair.second]);
            let friction = 0.5 * (first.friction + second.friction);
            let restitution = 0.5 * (first.restitution + second.restitution);
            let least = Cell::new(margin);
            let mut found = |swapped: bool, feature: u32, point, normal, distance| {
                least.set(least.get().min(distance));
                let colliders = if swapped { (pair.second, pair.first) } else { (pair.first, pair.second) };
                let owners = if swapped { (second.owner, first.owner) } else { (first.owner, second.owner) };
                let key = (index as u64) << 32 | u64::from(swapped) << 31 | u64::from(feature);
                let point =
                    ContactPoint { key, colliders, owners, point, normal, distance, friction, restitution };
                keep(points, point);
            };
            // A sphere has one feature, which finds all there is.
            let round = |collider: &Collider| matches!(collider.shape, ConvexShape::Sphere { .. });
            if !round(second) || round(first) {
                search((first, a), (second, b), margin, |f, p, n, d| found(false, f, p, n, d));
            }
            if !round(first) {
                search((second, b), (first, a), margin, |f, p, n, d| found(true, f, p, n, d));
            }
            if !pair.half_space
                && let Some(nearest) = distances.distance_within(model, pair.index, margin)
                && nearest.distance < least.get() - MISSED
            {
                let [p, q] = nearest.points;
                let point = nalgebra::center(&p, &q);
                found(false, NEAREST, point, -nearest.normal.into_inner(), nearest.distance);
            }
        }
        self.complete_within = if self.points.len() < MOST { margin } else { 0.0 };
        &self.points
    }
}

/// The features of `from` that are near the surface of `onto`.
fn search(
    (from, from_pose): (&Collider, &Isometry3<f64>),
    (onto, onto_pose): (&Collider, &Isometry3<f64>),
    margin: f64,
    mut found: impl FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) {
    let relative = onto_pose.inv_mul(from_pose);
    let Some((_, away)) = onto.shape.surface(&relative.translation.vector) else { return };
    let towards = relative.rotation.inverse_transform_vector(&-away);
    from.shape.features(&towards, &mut |Feature { index, point, radius }| {
        let place = relative * Point3::from(point);
        let Some((height, normal)) = onto.shape.surface_towards(&place.coords, &away) else { return };
        let distance = height - radius;
        if distance < margin {
            let middle = place - normal * (radius + 0.5 * distance);
            found(index, onto_pose * middle, onto_pose * normal, distance);
        }
    });
}

/// Adds a contact point; where there is no room it takes the place of the shallowest.
fn keep(points: &mut Vec<ContactPoint>, point: ContactPoint) {
    if points.len() < MOST {
        points.push(point);
        return;
    }
    let shallowest = points.iter_mut().max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(shallowest) = shallowest.filter(|other| other.distance > point.distance) {
        *shallowest = point;
    }
}
