//! Contact generation: the points where colliders touch, or soon may.

use std::cell::Cell;

use motorium_robots::{Collisions, ConvexShape, Kinematics};
use nalgebra::{Isometry3, IsometryMatrix3, Point3, Vector3};

use super::bounds::{self, Motions};
use super::colliders::{Collider, Colliders, Owner};
use super::features::{ContactGeometry, Feature};
use super::objects::FreeBody;
use super::terrain;

/// Contact points kept at once, for the robots and for each object that moves. Of more, the deepest.
const MOST: usize = 96;
const MOST_EACH: usize = 16;

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
    /// Bound of the speed of the surfaces relative to one another \[m/s\].
    pub(crate) speed: f64,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    /// Index in the pairs of the collision model.
    index: usize,
    first: usize,
    second: usize,
    /// Origins farther apart than this are not near one another \[m\]; infinite for a half-space.
    reach: f64,
    half_space: bool,
    /// Which part of the motions counts.
    part: usize,
    /// The pair needs no measurement until the ways of both have come this near \[m\].
    until: f64,
}

/// The nearest points of a pair are a contact point of their own when they are nearer than all features by this \[m\].
const MISSED: f64 = 1e-4;

/// Number of the nearest points among the features of a pair.
const NEAREST: u32 = u32::MAX >> 1;

/// Margin within which contact points are found at least \[m\].
const FORESIGHT: f64 = 0.002;

/// Share of the way at the present speed that is added to it.
const HASTE: f64 = 1.5;

/// Beyond its margin a distance is measured up to this \[m\], so that it need not be again for a while.
const AHEAD: f64 = 0.05;

/// Error of a measured distance \[m\].
const ROUNDING: f64 = 1e-6;

/// A workspace that finds contact points. Nothing allocates after [`new`](Self::new).
///
/// The points of a pair are the [features](ContactGeometry::features) of each collider near the surface of the other.
/// If these miss the contact, as between edges that cross or on a hull, the nearest points of the two are used. Pairs
/// that cannot have come near since they were measured last are passed over ([`Motions`]).
pub(crate) struct Detector {
    pairs: Vec<Pair>,
    points: Vec<ContactPoint>,
    /// Largest number of contact points.
    most: usize,
    distances: Collisions,
    motions: Motions,
    /// Colliders that are not the terrain.
    solids: usize,
}

/// The state of a [`Detector`] that later detections depend on.
#[derive(Clone, Debug)]
pub(crate) struct DetectorState {
    until: Vec<f64>,
    motions: Motions,
    hints: Vec<[f64; 3]>,
    points: Vec<ContactPoint>,
}

impl Detector {
    /// For all pairs of the collision model. A half-space is the second of its pairs.
    pub(crate) fn new(Colliders { colliders, model, .. }: &Colliders) -> Self {
        let mut pairs: Vec<_> = model
            .pairs()
            .iter()
            .enumerate()
            .map(|(index, &[first, second])| {
                let (a, b) = (&colliders[first], &colliders[second]);
                let half_space = b.shape == ConvexShape::HalfSpace;
                let reach = a.shape.bounding_radius() + b.shape.bounding_radius();
                let part = bounds::part([a, b]);
                Pair { index, first, second, reach, half_space, part, until: f64::NEG_INFINITY }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| (pair.first, pair.second));
        let mut distances = Collisions::new(model);
        for (index, collider) in colliders.iter().enumerate().take(model.solid_count()) {
            distances.set_pose(index, &collider.placement);
        }
        let objects = colliders.iter().filter(|collider| matches!(collider.owner, Owner::Object(_))).count();
        let most = MOST + MOST_EACH * objects;
        let points = Vec::with_capacity(most);
        let solids = model.solid_count();
        Self { pairs, points, most, distances, motions: Motions::new(colliders), solids }
    }

    /// Largest number of contact points.
    pub(crate) fn capacity(&self) -> usize {
        self.most
    }

    /// The points found last.
    pub(crate) fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// Forgets the last step.
    pub(crate) fn forget(&mut self) {
        self.points.clear();
        self.distances.forget();
        self.motions.forget();
        self.pairs.iter_mut().for_each(|pair| pair.until = f64::NEG_INFINITY);
    }

    /// All that later detections depend on.
    pub(crate) fn save(&self) -> DetectorState {
        DetectorState {
            until: self.pairs.iter().map(|pair| pair.until).collect(),
            motions: self.motions.clone(),
            hints: self.distances.hints(),
            points: self.points.clone(),
        }
    }

    /// True for a state of a detector with as many pairs.
    pub(crate) fn fits(&self, state: &DetectorState) -> bool {
        self.pairs.len() == state.until.len()
    }

    /// Goes back to a saved state of this detector.
    pub(crate) fn restore(&mut self, state: &DetectorState) {
        for (pair, until) in self.pairs.iter_mut().zip(&state.until) {
            pair.until = *until;
        }
        self.motions = state.motions.clone();
        self.distances.set_hints(&state.hints);
        self.points.clone_from(&state.points);
    }

    /// Places a collider of the world.
    pub(crate) fn set_pose(&mut self, collider: usize, pose: Isometry3<f64>) {
        if collider >= self.solids {
            return;
        }
        self.distances.set_pose(collider, &pose);
        // The world stands still, but for this: its way is not followed.
        for pair in self.pairs.iter_mut().filter(|pair| [pair.first, pair.second].contains(&collider)) {
            pair.until = f64::NEG_INFINITY;
        }
    }

    /// Places the colliders of each articulation as its `kinematics` stands, its base as in `bases`, and those of
    /// `objects`.
    pub(crate) fn set_poses<'a>(
        &mut self,
        Colliders { colliders, model, .. }: &Colliders,
        (kinematics, bases): (impl Fn(usize) -> &'a Kinematics, &[Isometry3<f64>]),
        objects: &[FreeBody],
    ) {
        for of in 0..bases.len() {
            self.distances.update_robot(model, of, kinematics(of));
        }
        for (index, collider) in colliders.iter().enumerate() {
            if let Owner::Object(object) = collider.owner {
                self.distances.set_pose(index, &(objects[object].pose * collider.placement));
            }
        }
        self.motions.follow(colliders, &self.distances, (kinematics, bases), objects);
    }

    /// Height of the lowest point of an articulation \[m\]; infinite without colliders.
    pub(crate) fn lowest(&self, colliders: &[Collider], articulation: usize) -> f64 {
        let mut lowest = f64::INFINITY;
        let own = |collider: &Collider| collider.owner.articulation() == Some(articulation);
        for (index, collider) in colliders.iter().enumerate().filter(|(_, collider)| own(collider)) {
            let pose = self.distances.pose(index);
            let down = pose.rotation.inverse_transform_vector(&-Vector3::z());
            collider.shape.features(&down, &mut |feature| {
                lowest = lowest.min((pose * Point3::from(feature.point)).z - feature.radius);
            });
        }
        lowest
    }

    /// Height of the lowest point of an articulation above the terrain below it \[m\]; `None` without a terrain.
    pub(crate) fn above_terrain(&self, colliders: &Colliders, articulation: usize) -> Option<f64> {
        terrain::clearance(colliders, articulation, &self.distances)
    }

    /// Finds all contact points closer than `least` \[m\], and those that may touch within `h` \[s\].
    pub(crate) fn detect(&mut self, all: &Colliders, h: f64, least: f64) -> &[ContactPoint] {
        let Colliders { colliders, model, .. } = all;
        let Self { pairs, points, most, distances, motions, .. } = self;
        points.clear();
        for (index, pair) in pairs.iter_mut().enumerate() {
            let (way, speed) = motions.of_pair(pair.part, pair.first, pair.second);
            let margin = margin(h, speed).max(least);
            if pair.until - way > margin {
                continue;
            }
            if !pair.half_space {
                let gap = distances.position(pair.first) - distances.position(pair.second);
                let gap = gap.norm() - pair.reach;
                if gap > margin + AHEAD {
                    pair.until = gap + way - ROUNDING;
                    continue;
                }
            }
            let Some(nearest) = distances.distance_within(model, pair.index, margin + AHEAD) else {
                pair.until = margin + AHEAD + way - ROUNDING;
                continue;
            };
            pair.until = nearest.distance + way - ROUNDING;
            if nearest.distance > margin {
                continue;
            }
            let (a, b) = (&distances.pose(pair.first), &distances.pose(pair.second));
            let (first, second) = (&colliders[pair.first], &colliders[pair.second]);
            let friction = 0.5 * (first.friction + second.friction);
            let restitution = 0.5 * (first.restitution + second.restitution);
            let least = Cell::new(margin);
            let mut found = |swapped: bool, feature: u32, point, normal, distance| {
                least.set(least.get().min(distance));
                let colliders = if swapped { (pair.second, pair.first) } else { (pair.first, pair.second) };
                let owners = if swapped { (second.owner, first.owner) } else { (first.owner, second.owner) };
                let key = (index as u64) << 32 | u64::from(swapped) << 31 | u64::from(feature);
                keep(
                    (points, *most),
                    ContactPoint {
                        key,
                        colliders,
                        owners,
                        point,
                        normal,
                        distance,
                        speed,
                        friction,
                        restitution,
                    },
                );
            };
            // A sphere has one feature, which finds all there is.
            let round = |collider: &Collider| matches!(collider.shape, ConvexShape::Sphere { .. });
            if !round(second) || round(first) {
                search((first, a), (second, b), margin, |f, p, n, d| found(false, f, p, n, d));
            }
            if !round(first) {
                search((second, b), (first, a), margin, |f, p, n, d| found(true, f, p, n, d));
            }
            if !pair.half_space && nearest.distance < least.get() - MISSED {
                let [p, q] = nearest.points;
                let point = nalgebra::center(&p, &q);
                found(false, NEAREST, point, -nearest.normal.into_inner(), nearest.distance);
            }
        }
        let near = |speed| margin(h, speed).max(least);
        terrain::detect(all, distances, motions, near, &mut |point| keep((points, *most), point));
        &self.points
    }

    /// Drops the points that cannot touch within `h` \[s\].
    pub(crate) fn keep_for(&mut self, h: f64) -> &[ContactPoint] {
        self.points.retain(|point| point.distance < margin(h, point.speed));
        &self.points
    }
}

/// The distance within which surfaces that move at `speed` \[m/s\] may touch in a step of `h` \[s\].
fn margin(h: f64, speed: f64) -> f64 {
    FORESIGHT + HASTE * h * speed
}

/// The features of `from` that are near the surface of `onto`.
fn search(
    (from, from_pose): (&Collider, &IsometryMatrix3<f64>),
    (onto, onto_pose): (&Collider, &IsometryMatrix3<f64>),
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
fn keep((points, most): (&mut Vec<ContactPoint>, usize), point: ContactPoint) {
    if points.len() < most {
        points.push(point);
        return;
    }
    let shallowest = points.iter_mut().max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(shallowest) = shallowest.filter(|other| other.distance > point.distance) {
        *shallowest = point;
    }
}
