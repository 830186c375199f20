//! Sweeps over the contact points of a large island, body by body, without forming the Delassus matrix.

use core::ops::Range;

use nalgebra::Vector3;

use super::site::{Mobility, Side, Site};

/// Largest number of sweeps, and the largest number before another method takes over.
const SWEEPS: usize = 50;
pub(super) const FEW: usize = 10;

/// Velocity change \[m/s\] in a sweep below which the sweeps end. The second value is relative to the largest
/// velocity that an impulse causes at its own point, as in impacts.
const SETTLED: f64 = 1e-6;
const SETTLED_SHARE: f64 = 1e-4;

/// Velocity change \[m/s\] below which the sweeps end if another method takes over otherwise. That method is
/// more accurate if sweeps converge slowly, as in a tower.
const SETTLED_OF_FEW: f64 = 1e-7;

/// Half solutions of the contact points on articulations.
#[derive(Clone, Copy)]
pub(super) struct Reduced<'a> {
    /// Number of velocities of all articulations.
    pub(super) n: usize,
    /// `n` rows for each contact point.
    pub(super) rows: &'a [[f64; 4]],
    /// Indices of nonzero rows, up to `n` for each contact point, and their number.
    pub(super) support: &'a [u32],
    pub(super) supported: &'a [usize],
}

impl Reduced<'_> {
    /// Returns the nonzero rows of a contact point with their indices.
    #[inline]
    fn rows_of_point(&self, point: usize) -> impl Iterator<Item = (usize, &[f64; 4])> {
        let own = &self.rows[point * self.n..][..self.n];
        let support = &self.support[point * self.n..][..self.supported[point]];
        support.iter().map(move |k| (*k as usize, &own[*k as usize]))
    }
}

/// Workspace of the extrapolation between sweeps.
#[derive(Clone, Debug)]
pub(super) struct Room {
    /// Change of each impulse in a sweep, and the extrapolation direction.
    change: Vec<f64>,
    direction: Vec<f64>,
    /// `sum` before the sweep, and its part of the direction.
    before: Vec<f64>,
    along: Vec<f64>,
    /// The objects of the island.
    objects: Vec<u32>,
}

impl Room {
    /// Creates a workspace for up to `points` contact points, `n` velocities of articulations and `objects`
    /// objects.
    pub(super) fn new(points: usize, n: usize, objects: usize) -> Self {
        Self {
            change: vec![0.0; 3 * points],
            direction: vec![0.0; 3 * points],
            before: vec![0.0; n],
            along: vec![0.0; n],
            objects: Vec::with_capacity(objects),
        }
    }
}

/// A large island.
///
/// The velocities of free objects, and half a solution `sum` of the articulations for all impulses, are kept
/// up to date. Solving a contact point thus costs only the one or two bodies that meet there.
pub(super) struct Island<'a, P: Fn(usize) -> usize> {
    pub(super) sites: &'a [Site],
    pub(super) lambda: &'a mut [f64],
    pub(super) bodies: &'a mut [Mobility],
    pub(super) reduced: Reduced<'a>,
    pub(super) sum: &'a mut [f64],
    pub(super) room: &'a mut Room,
    /// Places of the island's points, and the map from a place to a point.
    pub(super) places: Range<usize>,
    pub(super) point: P,
}

impl<P: Fn(usize) -> usize> Island<'_, P> {
    /// Computes the impulses, starting from their current values, with up to [`SWEEPS`] sweeps, or up to
    /// [`FEW`] if `few` is true. On entry the objects have their velocities without impulses and `sum` is
    /// zero. Returns `true` if the sweeps settled.
    pub(super) fn solve(&mut self, few: bool) -> bool {
        self.room.objects.clear();
        for place in self.places.clone() {
            let index = (self.point)(place);
            for side in self.sites[index].sides {
                if let Some(object) = side.object()
                    && !core::mem::replace(&mut self.bodies[object].listed, true)
                {
                    self.room.objects.push(object as u32);
                }
            }
            if self.sites[index].immovable {
                self.lambda[3 * index..][..3].fill(0.0);
            }
            let warm = [0, 1, 2].map(|part| self.lambda[3 * index + part]);
            self.push(index, &warm);
        }
        let bounds = if few { (FEW, [SETTLED_OF_FEW, 0.0]) } else { (SWEEPS, [SETTLED, SETTLED_SHARE]) };
        let settled = self.sweep_until_settled(bounds);
        for object in &self.room.objects {
            self.bodies[*object as usize].listed = false;
        }
        settled
    }

    /// Sweeps until the impulses settle. Between sweeps the impulses are extrapolated along the conjugate of
    /// their last changes, as in the nonlinear conjugate gradient method of Silcowitz and others (2010).
    /// Every extrapolation is followed by a sweep, so the final impulses are in their cones.
    fn sweep_until_settled(&mut self, (most, [settled, share_settled]): (usize, [f64; 2])) -> bool {
        let mut before = f64::INFINITY;
        for sweep in 0..most {
            self.begin_sweep();
            let (mut change, mut largest, mut squared) = (0.0_f64, 0.0_f64, 0.0);
            for step in 0..self.places.len() {
                // Alternate directions, so that impulses pass through a pile both ways.
                let place =
                    if sweep % 2 == 0 { self.places.start + step } else { self.places.end - 1 - step };
                let index = (self.point)(place);
                let moved = self.relax(index);
                self.room.change[3 * index..][..3].copy_from_slice(&moved);
                if moved == [0.0; 3] {
                    continue;
                }
                let diagonal = &self.sites[index].answer.diagonal;
                largest = largest.max(self.lambda[3 * index] * diagonal[0]);
                for (moved, diagonal) in moved.iter().zip(diagonal) {
                    change = change.max((moved * diagonal).abs());
                    // Weighted by the mobility, so that light and heavy bodies count equally.
                    squared += moved * moved * diagonal;
                }
            }
            if change < settled.max(share_settled * largest) {
                return true;
            }
            if sweep + 1 == most {
                break;
            }
            let share = squared / before;
            before = squared;
            // Growing changes show that the direction diverges.
            self.extrapolate(if share < 1.0 { share } else { 0.0 });
        }
        false
    }

    /// Stores the velocities before a sweep.
    fn begin_sweep(&mut self) {
        let Self { room, bodies, sum, .. } = self;
        for object in &room.objects {
            let body = &mut bodies[*object as usize];
            body.before = [body.linear, body.angular];
        }
        room.before.copy_from_slice(sum);
    }

    /// Extrapolates along `share` of the last direction, and adds the last change to it. Velocities are
    /// linear in the impulses, so they are extrapolated along their parts of the direction.
    fn extrapolate(&mut self, share: f64) {
        let Self { room, bodies, sum, lambda, places, point, .. } = self;
        let last = |direction: f64| if share > 0.0 { share * direction } else { 0.0 };
        for index in places.clone().map(&*point) {
            for at in 3 * index..3 * index + 3 {
                let step = last(room.direction[at]);
                room.direction[at] = step + room.change[at];
                lambda[at] += step;
            }
        }
        for object in &room.objects {
            let body = &mut bodies[*object as usize];
            let Mobility { linear, angular, before, along, .. } = body;
            for ((velocity, before), along) in [linear, angular].into_iter().zip(before).zip(along) {
                let step = along.map(last);
                *along = step + (*velocity - *before);
                *velocity += step;
            }
        }
        for ((sum, before), along) in sum.iter_mut().zip(&room.before).zip(&mut room.along) {
            let step = last(*along);
            *along = step + (*sum - before);
            *sum += step;
        }
    }

    /// Returns the relative velocity of the surfaces at a contact point due to the motion of the objects,
    /// world axes.
    #[inline]
    fn relative(&self, site: &Site) -> Vector3<f64> {
        let of = |side: &Side| match side {
            Side::Object(object, arm) => self.bodies[*object].velocity_at(arm),
            Side::Turned(object) => self.bodies[*object].angular,
            Side::World | Side::Articulation(_) => Vector3::zeros(),
        };
        of(&site.sides[0]) - of(&site.sides[1])
    }

    /// Applies an impulse at a contact point.
    #[inline]
    fn push(&mut self, index: usize, impulse: &[f64; 3]) {
        let site = &self.sites[index];
        let vector = site.vector(impulse);
        for (side, sign) in site.sides.iter().zip([1.0, -1.0]) {
            if let Some(object) = side.object() {
                self.bodies[object].take(side, &(vector * sign));
            }
        }
        for (k, row) in self.reduced.rows_of_point(index) {
            self.sum[k] += row[0] * impulse[0] + row[1] * impulse[1] + row[2] * impulse[2];
        }
    }

    /// Solves one contact point with the impulses at the other points fixed. Returns the change of its
    /// impulse.
    #[inline]
    fn relax(&mut self, index: usize) -> [f64; 3] {
        let site = &self.sites[index];
        if site.immovable {
            return [0.0; 3];
        }
        let old = [0, 1, 2].map(|part| self.lambda[3 * index + part]);
        let relative = self.relative(site);
        let mut velocity = site.free;
        for (k, row) in self.reduced.rows_of_point(index) {
            for (velocity, entry) in velocity.iter_mut().zip(row) {
                *velocity += entry * self.sum[k];
            }
        }
        velocity[0] += site.axes[0].dot(&relative);
        // Most of the points that may touch within the step do not touch.
        if old == [0.0; 3] && site.couple.is_none() && velocity[0] >= site.target {
            return [0.0; 3];
        }
        velocity[1] += site.axes[1].dot(&relative);
        velocity[2] += site.axes[2].dot(&relative);
        let new = match site.couple {
            Some(couple) => {
                site.answer.relax_couple(&old, &velocity, couple.bounds(self.lambda[3 * couple.point]))
            }
            None => site.answer.relax(&old, &velocity, (site.target, site.friction)),
        };
        let step = [0, 1, 2].map(|part| new[part] - old[part]);
        if step != [0.0; 3] {
            self.lambda[3 * index..][..3].copy_from_slice(&new);
            self.push(index, &step);
        }
        step
    }
}
