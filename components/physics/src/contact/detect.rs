//! Where surfaces touch, or soon may.

use nalgebra::{Isometry3, Point3, Vector3};

use super::pieces::{Owner, Piece};
use super::solid::{Feature, Solid};

/// Touches kept at once. Of more, the deepest.
const MOST: usize = 96;

/// A point where two surfaces touch or soon may.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// The same number for the same features of the same two pieces.
    pub(crate) key: u64,
    /// The two pieces: the normal points from the second to the first.
    pub(crate) pieces: (usize, usize),
    pub(crate) owners: (Owner, Owner),
    pub(crate) point: Point3<f64>,
    pub(crate) normal: Vector3<f64>,
    /// Between the surfaces \[m\], negative where they overlap.
    pub(crate) distance: f64,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    first: usize,
    second: usize,
    /// Origins farther apart than this are not near one another \[m\]; infinite with the ground.
    reach: f64,
}

/// Looks for touches. Allocates nothing after [`new`](Self::new).
#[derive(Clone, Debug)]
pub(crate) struct Detector {
    pairs: Vec<Pair>,
    poses: Vec<Isometry3<f64>>,
    touches: Vec<Touch>,
}

impl Detector {
    /// For all pairs of `pieces` that are `allowed`.
    pub(crate) fn new(pieces: &[Piece], allowed: impl Fn(usize, usize) -> bool) -> Self {
        let mut pairs = Vec::new();
        for first in 0..pieces.len() {
            for second in first + 1..pieces.len() {
                if allowed(first, second) {
                    let reach = pieces[first].solid.reach() + pieces[second].solid.reach();
                    pairs.push(Pair { first, second, reach });
                }
            }
        }
        let poses = pieces.iter().map(|piece| piece.placement).collect();
        Self { pairs, poses, touches: Vec::with_capacity(MOST) }
    }

    /// Room for as many touches.
    pub(crate) fn capacity(&self) -> usize {
        MOST
    }

    /// What was found last.
    pub(crate) fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Places a piece of the world.
    pub(crate) fn set_pose(&mut self, piece: usize, pose: Isometry3<f64>) {
        self.poses[piece] = pose;
    }

    /// Takes note of where everything is.
    pub(crate) fn place(&mut self, pieces: &[Piece], pose: impl Fn(Owner) -> Isometry3<f64>) {
        for (piece, place) in pieces.iter().zip(&mut self.poses) {
            if piece.owner != Owner::World {
                *place = pose(piece.owner) * piece.placement;
            }
        }
    }

    /// Height of the lowest point of the robot \[m\]; infinite without pieces.
    pub(crate) fn lowest(&self, pieces: &[Piece]) -> f64 {
        let mut lowest = f64::INFINITY;
        for (piece, pose) in pieces.iter().zip(&self.poses).filter(|(piece, _)| piece.owner.is_robot()) {
            let down = pose.rotation.inverse_transform_vector(&-Vector3::z());
            piece.solid.features(&down, &mut |feature| {
                lowest = lowest.min((pose * Point3::from(feature.point)).z - feature.radius);
            });
        }
        lowest
    }

    /// Finds all touches closer than `margin` \[m\].
    pub(crate) fn detect(&mut self, pieces: &[Piece], margin: f64) -> &[Touch] {
        let Self { pairs, poses, touches } = self;
        touches.clear();
        for (index, pair) in pairs.iter().enumerate() {
            let (a, b) = (&poses[pair.first], &poses[pair.second]);
            let far = if pair.reach.is_finite() {
                let apart = a.translation.vector - b.translation.vector;
                apart.norm_squared() > (pair.reach + margin).powi(2)
            } else {
                // One of them is the ground, which is the last of all pieces.
                a.translation.z - b.translation.z > pieces[pair.first].solid.reach() + margin
            };
            if far {
                continue;
            }
            let (first, second) = (&pieces[pair.first], &pieces[pair.second]);
            let friction = 0.5 * (first.friction + second.friction);
            let restitution = 0.5 * (first.restitution + second.restitution);
            let mut found = |swapped: bool, feature: u32, point, normal, distance| {
                let pieces = if swapped { (pair.second, pair.first) } else { (pair.first, pair.second) };
                let owners = if swapped { (second.owner, first.owner) } else { (first.owner, second.owner) };
                let key = (index as u64) << 32 | u64::from(swapped) << 31 | u64::from(feature);
                let touch = Touch { key, pieces, owners, point, normal, distance, friction, restitution };
                keep(touches, touch);
            };
            // A sphere has one feature, which finds all there is.
            let round = |piece: &Piece| matches!(piece.solid, Solid::Sphere { .. });
            if !round(second) || round(first) {
                search((first, a), (second, b), margin, |f, p, n, d| found(false, f, p, n, d));
            }
            if !round(first) {
                search((second, b), (first, a), margin, |f, p, n, d| found(true, f, p, n, d));
            }
        }
        touches
    }
}

/// The features of `from` that are near the surface of `onto`.
fn search(
    (from, from_pose): (&Piece, &Isometry3<f64>),
    (onto, onto_pose): (&Piece, &Isometry3<f64>),
    margin: f64,
    mut found: impl FnMut(u32, Point3<f64>, Vector3<f64>, f64),
) {
    let relative = onto_pose.inv_mul(from_pose);
    let Some((_, away)) = onto.solid.surface(&relative.translation.vector) else { return };
    let towards = relative.rotation.inverse_transform_vector(&-away);
    from.solid.features(&towards, &mut |Feature { index, point, radius }| {
        let place = relative * Point3::from(point);
        let Some((height, normal)) = onto.solid.surface_towards(&place.coords, &away) else { return };
        let distance = height - radius;
        if distance < margin {
            // Halfway between the surfaces.
            let middle = place - normal * (radius + 0.5 * distance);
            found(index, onto_pose * middle, onto_pose * normal, distance);
        }
    });
}

/// Adds a touch; where there is no room it takes the place of the shallowest.
fn keep(touches: &mut Vec<Touch>, touch: Touch) {
    if touches.len() < MOST {
        touches.push(touch);
        return;
    }
    let shallowest = touches.iter_mut().max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(shallowest) = shallowest.filter(|other| other.distance > touch.distance) {
        *shallowest = touch;
    }
}
