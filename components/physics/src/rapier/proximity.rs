//! Is the robot about to touch anything?

use nalgebra::Isometry3;
use rapier3d_f64::math::Pose;
use rapier3d_f64::parry::query;

use super::convert;
use super::surfaces::{Owner, PairTable, Surface};

/// Closer than this to anything it may touch, the robot is handed to the contact solver \[m\]. At 1 kHz nothing slower
/// than 10 m/s jumps over it.
pub(super) const ENTER: f64 = 0.010;

/// Farther than this from everything, it is taken back \[m\].
pub(super) const LEAVE: f64 = 0.015;

/// Distances between the moving robot and all it may touch.
#[derive(Clone)]
pub(super) struct Proximity {
    pairs: Vec<Pair>,
    /// Pose of every surface in the world.
    poses: Vec<Pose>,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    first: usize,
    second: usize,
    /// Centres farther apart than this need no closer look \[m\].
    reach: f64,
}

impl Proximity {
    pub(super) fn new(surfaces: &[Surface], table: &PairTable) -> Self {
        let mut pairs = Vec::new();
        for first in 0..surfaces.len() {
            for second in 0..first {
                let moving = |index: usize| matches!(surfaces[index].owner, Owner::Body(_));
                if table.allows(first, second) && (moving(first) || moving(second)) {
                    pairs.push(Pair {
                        first,
                        second,
                        reach: surfaces[first].radius + surfaces[second].radius + LEAVE,
                    });
                }
            }
        }
        Self { pairs, poses: vec![Pose::IDENTITY; surfaces.len()] }
    }

    /// Takes note of where everything is; `pose` gives that of an owner in the world.
    pub(super) fn place(&mut self, surfaces: &[Surface], pose: impl Fn(Owner) -> Isometry3<f64>) {
        for (surface, world) in surfaces.iter().zip(&mut self.poses) {
            *world = convert::pose(&(pose(surface.owner) * surface.placement));
        }
    }

    /// Whether any pair is closer than `margin` (at most [`LEAVE`]).
    pub(super) fn any_within(&self, surfaces: &[Surface], margin: f64) -> bool {
        self.pairs.iter().any(|pair| self.distance(surfaces, pair) < margin)
    }

    /// Every pair closer than `margin` (at most [`LEAVE`]), with its distance; zero when the surfaces overlap.
    pub(super) fn within<'a>(
        &'a self,
        surfaces: &'a [Surface],
        margin: f64,
    ) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
        self.pairs.iter().filter_map(move |pair| {
            let distance = self.distance(surfaces, pair);
            (distance < margin).then_some((pair.first, pair.second, distance))
        })
    }

    /// Distance of a pair \[m\]; infinite when their bounding spheres are apart.
    fn distance(&self, surfaces: &[Surface], pair: &Pair) -> f64 {
        let (a, b) = (&self.poses[pair.first], &self.poses[pair.second]);
        if pair.reach.is_finite()
            && (a.translation - b.translation).length_squared() > pair.reach * pair.reach
        {
            return f64::INFINITY;
        }
        // Every pair of these shapes is supported; were one not, it must count as near.
        let (first, second) = (&*surfaces[pair.first].shape, &*surfaces[pair.second].shape);
        query::distance(a, first, b, second).map_or(0.0, |found| found.distance)
    }
}
