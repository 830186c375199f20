//! Sweeps over the contact points of a large island, body by body: the Delassus matrix is never formed.

use core::ops::Range;

use super::cone::relax_point;
use super::site::{Mobility, Side, Site};

/// Largest number of sweeps.
const SWEEPS: usize = 200;

/// Change of a velocity \[m/s\] in a sweep below which the sweeps end.
const SETTLED: f64 = 1e-8;

/// Half solutions of the contact points on articulations.
#[derive(Clone, Copy)]
pub(super) struct Reduced<'a> {
    /// Number of velocities of all articulations.
    pub(super) n: usize,
    /// `n` rows for each contact point.
    pub(super) rows: &'a [[f64; 4]],
    /// Those that are not zero, up to `n` for each contact point, and their number.
    pub(super) support: &'a [u32],
    pub(super) supported: &'a [usize],
}

impl Reduced<'_> {
    /// The rows of a contact point that are not zero, with their places.
    #[inline]
    fn of(&self, point: usize) -> impl Iterator<Item = (usize, &[f64; 4])> {
        let own = &self.rows[point * self.n..][..self.n];
        let support = &self.support[point * self.n..][..self.supported[point]];
        support.iter().map(move |k| (*k as usize, &own[*k as usize]))
    }
}

/// A large island.
///
/// The velocities of free objects and, of articulations, half a solution `sum` for all impulses are kept up to date, so
/// that a contact point is solved at the cost of the one or two bodies that meet there.
pub(super) struct Island<'a, P: Fn(usize) -> usize> {
    pub(super) sites: &'a [Site],
    pub(super) lambda: &'a mut [f64],
    pub(super) bodies: &'a mut [Mobility],
    pub(super) reduced: Reduced<'a>,
    pub(super) sum: &'a mut [f64],
    /// Places of its points, and the point at a place.
    pub(super) places: Range<usize>,
    pub(super) point: P,
}

impl<P: Fn(usize) -> usize> Island<'_, P> {
    /// Finds the impulses, from those they are now. The velocities of its objects are those without impulses; `sum` is
    /// zero.
    pub(super) fn solve(&mut self) {
        for place in self.places.clone() {
            let index = (self.point)(place);
            if self.sites[index].immovable {
                self.lambda[3 * index..][..3].fill(0.0);
            }
            let warm = [0, 1, 2].map(|part| self.lambda[3 * index + part]);
            self.push(index, &warm);
        }
        for sweep in 0..SWEEPS {
            let mut change = 0.0_f64;
            for step in 0..self.places.len() {
                // To and fro, so that impulses run through a pile both ways.
                let place =
                    if sweep % 2 == 0 { self.places.start + step } else { self.places.end - 1 - step };
                change = change.max(self.relax((self.point)(place)));
            }
            if change < SETTLED {
                break;
            }
        }
    }

    /// Velocity of a contact point along its axes.
    #[inline]
    fn velocity(&self, index: usize) -> [f64; 3] {
        let site = &self.sites[index];
        let mut velocity = site.free;
        for (side, sign) in site.sides.iter().zip([1.0, -1.0]) {
            if let Side::Object(object, arm) = side {
                let moved = self.bodies[*object].velocity_at(arm) * sign;
                for (velocity, axis) in velocity.iter_mut().zip(&site.axes) {
                    *velocity += axis.dot(&moved);
                }
            }
        }
        for (k, row) in self.reduced.of(index) {
            for (velocity, entry) in velocity.iter_mut().zip(row) {
                *velocity += entry * self.sum[k];
            }
        }
        velocity
    }

    /// Takes in an impulse at a contact point.
    #[inline]
    fn push(&mut self, index: usize, impulse: &[f64; 3]) {
        let site = &self.sites[index];
        let vector = site.vector(impulse);
        for (side, sign) in site.sides.iter().zip([1.0, -1.0]) {
            if let Side::Object(object, arm) = side {
                self.bodies[*object].push(arm, &(vector * sign));
            }
        }
        for (k, row) in self.reduced.of(index) {
            self.sum[k] += row[0] * impulse[0] + row[1] * impulse[1] + row[2] * impulse[2];
        }
    }

    /// Solves one contact point for fixed impulses at the others. Returns the largest change of its velocity.
    #[inline]
    fn relax(&mut self, index: usize) -> f64 {
        let site = &self.sites[index];
        if site.immovable {
            return 0.0;
        }
        let old = [0, 1, 2].map(|part| self.lambda[3 * index + part]);
        let new = relax_point(&site.own, &old, &self.velocity(index), (site.target, site.friction));
        let step = [0, 1, 2].map(|part| new[part] - old[part]);
        if step == [0.0; 3] {
            return 0.0;
        }
        let change = (0..3).fold(0.0_f64, |most, part| most.max((step[part] * site.own[part][part]).abs()));
        self.lambda[3 * index..][..3].copy_from_slice(&new);
        self.push(index, &step);
        change
    }
}
