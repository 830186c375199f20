//! Contact generation: the points where colliders touch, or may soon touch.

use motorium_robots::{Collisions, ConvexShape, Kinematics};
use nalgebra::{Isometry3, Point3, Vector3};

use super::bounds::{self, Motions, margin};
use super::calm::Calm;
use super::colliders::{Collider, Colliders, Owner};
use super::connections::Connections;
use super::features::ContactGeometry;
use super::narrow;
use super::near_pairs::NearPairs;
use super::objects::FreeBody;
use super::pair::Pair;
use super::parties::{Least, Parties};
use super::point::{ContactPoint, Motion, ROUNDING, UNKNOWN};
use super::surface::SurfaceLaw;
use super::terrain;
use crate::robot::{Articulation, Robot};

/// Largest number of contact points for the robots and for each movable object. If there are more, the
/// deepest are kept.
const MOST: usize = 96;
const MOST_EACH: usize = 16;

/// A workspace for contact detection. Nothing allocates after [`new`](Self::new).
///
/// [`narrow`] finds the points of a pair. Pairs that cannot have approached since their last measurement are
/// skipped ([`Motions`]), most of them without individual checks ([`NearPairs`]).
pub(crate) struct Detector {
    pairs: Vec<Pair>,
    near: NearPairs,
    points: Vec<ContactPoint>,
    /// The points of the last detection.
    earlier: Vec<ContactPoint>,
    /// One entry per collider.
    moving: Vec<Motion>,
    /// Largest number of contact points.
    most: usize,
    distances: Collisions,
    motions: Motions,
    calm: Calm,
    /// Number of colliders other than the terrain.
    solids: usize,
}

/// The state of a [`Detector`] that later detections depend on.
#[derive(Clone, Debug)]
pub(crate) struct DetectorState {
    until: Vec<f64>,
    near: NearPairs,
    motions: Motions,
    calm: Calm,
    hints: Vec<[f64; 3]>,
    points: Vec<ContactPoint>,
}

impl Detector {
    /// Creates a detector for all pairs of the collision model. A half-space is second in its pairs.
    pub(crate) fn new(
        Colliders { colliders, model, .. }: &Colliders,
        articulations: &[Articulation],
    ) -> Self {
        let mut pairs: Vec<_> = model
            .pairs()
            .iter()
            .enumerate()
            .map(|(index, &[first, second])| {
                let (a, b) = (&colliders[first], &colliders[second]);
                let half_space = b.shape == ConvexShape::HalfSpace;
                let reach = a.shape.bounding_radius() + b.shape.bounding_radius();
                let part = bounds::part([a, b]);
                let parties = Parties::new(a.owner, b.owner);
                Pair { index, first, second, reach, half_space, parties, part, until: f64::NEG_INFINITY }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| (pair.first, pair.second));
        let mut distances = Collisions::new(model);
        for (index, collider) in colliders.iter().enumerate().take(model.solid_count()) {
            distances.set_pose(index, &collider.placement);
        }
        let objects = colliders.iter().filter(|collider| matches!(collider.owner, Owner::Object(_))).count();
        let most = MOST + MOST_EACH * objects;
        let (points, earlier) = (Vec::with_capacity(most), Vec::with_capacity(most));
        let solids = model.solid_count();
        let moves = |collider: &Collider| match collider.owner {
            Owner::World => Motion::Rests,
            _ => Motion::Moves,
        };
        let moving = colliders.iter().map(moves).collect();
        let near = NearPairs::new(&pairs, colliders.len());
        let calm = Calm::new(colliders, articulations, pairs.len());
        Self {
            pairs,
            near,
            points,
            earlier,
            moving,
            most,
            distances,
            motions: Motions::new(colliders),
            calm,
            solids,
        }
    }

    /// Returns the largest number of contact points.
    pub(crate) fn capacity(&self) -> usize {
        self.most
    }

    /// Sets the state of each collider in the next integration step.
    pub(crate) fn set_moving(&mut self, colliders: &[Collider], of: impl Fn(Owner) -> Motion) {
        for (moving, collider) in self.moving.iter_mut().zip(colliders) {
            *moving = of(collider.owner);
        }
    }

    /// Returns the points of the last detection, for the caller to complete.
    pub(crate) fn points_mut(&mut self) -> &mut [ContactPoint] {
        &mut self.points
    }

    /// Returns the points of the last detection.
    pub(crate) fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// Returns `true` if there may be more contact points than fit.
    pub(crate) fn is_full(&self) -> bool {
        let touch = || self.points.iter().filter(|point| point.held.is_none()).count();
        self.points.len() >= self.most && touch() >= self.most
    }

    /// Clears the last step.
    pub(crate) fn forget(&mut self) {
        self.points.clear();
        self.near.forget();
        self.distances.forget();
        self.motions.forget();
        self.calm.forget();
        self.pairs.iter_mut().for_each(|pair| pair.until = f64::NEG_INFINITY);
    }

    /// Saves everything that later detections depend on.
    pub(crate) fn save(&self) -> DetectorState {
        DetectorState {
            until: self.pairs.iter().map(|pair| pair.until).collect(),
            near: self.near.clone(),
            motions: self.motions.clone(),
            calm: self.calm.clone(),
            hints: self.distances.hints(),
            points: self.points.clone(),
        }
    }

    /// Returns `true` if the state has the same number of pairs.
    pub(crate) fn fits(&self, state: &DetectorState) -> bool {
        self.pairs.len() == state.until.len()
    }

    /// Restores a saved state of this detector.
    pub(crate) fn restore(&mut self, state: &DetectorState) {
        for (pair, until) in self.pairs.iter_mut().zip(&state.until) {
            pair.until = *until;
        }
        self.near.clone_from(&state.near);
        self.motions = state.motions.clone();
        self.calm.clone_from(&state.calm);
        self.distances.set_hints(&state.hints);
        self.points.clone_from(&state.points);
    }

    /// Moves a collider of the world to a pose.
    pub(crate) fn set_pose(&mut self, collider: usize, pose: Isometry3<f64>) {
        if collider >= self.solids {
            return;
        }
        self.distances.set_pose(collider, &pose);
        self.near.forget();
        self.calm.forget();
        // World colliders do not move otherwise, so their motion is not tracked.
        for pair in self.pairs.iter_mut().filter(|pair| [pair.first, pair.second].contains(&collider)) {
            pair.until = f64::NEG_INFINITY;
        }
    }

    /// Places the colliders of each articulation according to its `kinematics` and its base in `bases`, and
    /// the colliders of `objects`.
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

    /// Returns `true` if nothing can touch in a step of `h` \[s\] of these robots. Their colliders need not
    /// be placed.
    pub(crate) fn is_calm(&mut self, robot: &Robot, h: f64) -> bool {
        let state = (&*robot.state.q, &*robot.state.v);
        self.calm.holds(&robot.articulations, state, (h, self.near.parts()))
    }

    /// Inspects the distances between the robots in their current poses and everything else, after a
    /// detection with these `least` distances.
    pub(crate) fn look_ahead(&mut self, robot: &Robot, least: Least) {
        let free = self.points.is_empty();
        let pairs = (&*self.pairs, &self.near, &self.motions);
        self.calm.look(&robot.articulations, &robot.state.q, pairs, (free, least));
    }

    /// Returns the height of the lowest point of an articulation \[m\]; infinite without colliders.
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

    /// Returns the height of the lowest point of an articulation above the terrain below it \[m\]; `None`
    /// without a terrain.
    pub(crate) fn above_terrain(&self, colliders: &Colliders, articulation: usize) -> Option<f64> {
        terrain::clearance(colliders, articulation, &self.distances)
    }

    /// Adds the points of connections with at least one side that `moves`.
    pub(crate) fn add_connections(&mut self, connections: &Connections, moves: impl Fn(Owner) -> bool) {
        self.points.extend(connections.points(moves));
    }

    /// Reserves space for this number of connection points.
    pub(crate) fn make_room(&mut self, points: usize) {
        self.points.reserve(self.most + points);
        self.earlier.reserve(self.most + points);
    }

    /// Finds all contact points closer than the `least` distance for their [parties](Parties) \[m\], and
    /// points that may touch within `h` \[s\]. Points between colliders that do not move in this integration
    /// step are kept from the last detection.
    pub(crate) fn detect(
        &mut self,
        all: &Colliders,
        connections: &Connections,
        (h, least): (f64, Least),
    ) -> &[ContactPoint] {
        let Self { pairs, near, points, earlier, moving, most, distances, motions, .. } = self;
        core::mem::swap(points, earlier);
        points.clear();
        near.update(pairs, distances, motions, (h, least.robots.max(least.grasps)));
        let moves = |index: usize| moving[index] == Motion::Moves;
        let done = |index: usize| moving[index] == Motion::Done;
        for &index in near.list() {
            let pair = &mut pairs[index as usize];
            if !(moves(pair.first) || moves(pair.second)) || done(pair.first) || done(pair.second) {
                continue;
            }
            let (way, speed) = motions.of_pair(pair.part, pair.first, pair.second);
            let margin = margin(h, speed).max(least.for_parties(pair.parties));
            if pair.until - way > margin {
                continue;
            }
            let (first, second) = (&all.colliders[pair.first], &all.colliders[pair.second]);
            if !pair.half_space && connections.joins([first.member(), second.member()]) {
                continue;
            }
            let places = [pair.first, pair.second];
            let law = SurfaceLaw::between([first, second], |place| distances.pose(places[place]).rotation);
            let mut found = |swapped: bool, feature: u32, point, normal, distance| {
                let colliders = if swapped { (pair.second, pair.first) } else { (pair.first, pair.second) };
                let owners = if swapped { (second.owner, first.owner) } else { (first.owner, second.owner) };
                let key = u64::from(index) << 32 | u64::from(swapped) << 31 | u64::from(feature);
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
                        law: if swapped { law.swapped() } else { law },
                        held: None,
                        h: UNKNOWN,
                        kept: false,
                    },
                );
            };
            pair.until = narrow::measure(&all.model, pair, [first, second], distances, margin, &mut found)
                + way
                - ROUNDING;
        }
        let near = |speed, owner| margin(h, speed).max(least.for_parties(Parties::new(owner, Owner::World)));
        terrain::detect((all, moving), distances, motions, near, &mut |point| keep((points, *most), point));
        let kept = |point: &&ContactPoint| {
            point.held.is_none() && !moves(point.colliders.0) && !moves(point.colliders.1)
        };
        for point in earlier.iter().filter(kept) {
            keep((points, *most), ContactPoint { kept: true, ..*point });
        }
        &self.points
    }

    /// Drops points that cannot touch within `h` \[s\].
    pub(crate) fn keep_for(&mut self, h: f64) -> &[ContactPoint] {
        self.points.retain(|point| point.kept || point.distance < margin(h, point.speed));
        &self.points
    }
}

/// Adds a contact point. If there is no room it replaces the shallowest one.
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
