//! The problem of one island: over its Delassus matrix, or over the velocities of its bodies.

use core::ops::Range;

use super::super::answer::PointAnswer;
use super::super::site::{Couple, ObjectRow, Side};
use super::super::sweeps::{Island, Reduced};
use super::{IMMOVABLE, Impulses};

impl Impulses {
    /// Solves an island over its Delassus matrix.
    pub(super) fn solve_dense(&mut self, places: Range<usize>) {
        let (points, rows) = (places.len(), 3 * places.len());
        for (local, place) in places.clone().enumerate() {
            let index = self.islands.point(place);
            for axis in 0..3 {
                self.rows[3 * local + axis] = self.sites[index].rows(axis, &self.bodies);
            }
            for (other, place) in (0..=local).zip(places.clone()) {
                let block = self.block((local, index), (other, self.islands.point(place)));
                for (part, entries) in block.iter().enumerate() {
                    for (column, entry) in entries[..3].iter().enumerate() {
                        self.cone.delassus[(3 * local + part) * rows + 3 * other + column] = *entry;
                        self.cone.delassus[(3 * other + column) * rows + 3 * local + part] = *entry;
                    }
                }
            }
            let diagonal = [0, 1, 2].map(|row| self.cone.delassus[(3 * local + row) * (rows + 1)]);
            self.aim(index, diagonal);
            let site = &self.sites[index];
            self.cone.couples[local] = site.couple.map(|couple| Couple {
                // Contact points come first, in order.
                point: places.clone().take_while(|place| self.islands.point(*place) < couple.point).count(),
                ..couple
            });
            (self.cone.target[local], self.cone.friction[local]) = (site.target, site.friction);
            self.cone.soft[local] = site.soft;
            self.cone.immovable[local] = site.immovable;
            self.cone.velocity[3 * local..][..3].copy_from_slice(&site.free);
            self.cone.lambda[3 * local..][..3].copy_from_slice(&self.lambda[3 * index..][..3]);
        }
        self.cone.solve(points);
        for (local, place) in places.enumerate() {
            let index = self.islands.point(place);
            self.lambda[3 * index..][..3].copy_from_slice(&self.cone.lambda[3 * local..][..3]);
        }
    }

    /// Solves an island over the velocities of its bodies. With `few`, at most
    /// [`FEW`](super::super::sweeps::FEW) sweeps run. Returns `true` if the sweeps settled.
    pub(super) fn solve_sparse(&mut self, places: Range<usize>, few: bool) -> bool {
        self.sum.fill(0.0);
        for place in places.clone() {
            let index = self.islands.point(place);
            let own = self.own_block(index);
            self.aim(index, [own[0][0], own[1][1], own[2][2]]);
            let site = &mut self.sites[index];
            site.answer = if site.couple.is_some() {
                PointAnswer::couple(&own)
            } else {
                PointAnswer::new(&own, site.soft)
            };
            // The velocities of the objects include their fall.
            for (free, falling) in site.free.iter_mut().zip(site.falling) {
                *free -= falling;
            }
            for side in site.sides {
                if let Some(object) = side.object() {
                    let (own, falling) = (&mut self.bodies[object], &self.falling[object]);
                    (own.linear, own.angular) = (falling.linear, falling.angular);
                }
            }
        }
        let Self { n, sites, lambda, bodies, reduced, support, supported, sum, islands, room, .. } = self;
        let reduced = Reduced { n: *n, rows: reduced, support, supported };
        let point = |place: usize| islands.point(place);
        let range = places.clone();
        let settled = Island { sites, lambda, bodies, reduced, sum, room, places, point }.solve(few);
        for place in range {
            let site = &mut self.sites[self.islands.point(place)];
            for (free, falling) in site.free.iter_mut().zip(site.falling) {
                *free += falling;
            }
        }
        settled
    }

    /// Adapts the target of a contact point to its mobilities along the three axes \[1/kg\], the normal
    /// first.
    fn aim(&mut self, index: usize, [mobility, one, other]: [f64; 3]) {
        let site = &mut self.sites[index];
        // Only the two bodies in contact count; other bodies in the world do not affect it.
        let articulations = site.articulations().map(|of| self.inverse_masses[of]);
        let objects = site.sides.iter().filter_map(|side| side.object());
        let inverse_mass: f64 =
            articulations.chain(objects.map(|object| self.bodies[object].inverse_mass)).sum();
        let mobility = if site.couple.is_some() { mobility.max(one).max(other) } else { mobility };
        site.immovable = mobility < IMMOVABLE * inverse_mass;
        if site.overlapping {
            site.target = (mobility / inverse_mass).min(1.0).sqrt() * site.recovery;
        }
    }

    /// Returns the W block of a contact point with itself.
    fn own_block(&self, index: usize) -> [[f64; 3]; 3] {
        let mut own = [[0.0; 3]; 3];
        let site = &self.sites[index];
        for side in site.sides {
            let Some(object) = side.object() else { continue };
            let body = &self.bodies[object];
            let turns = match side {
                Side::Object(_, arm) => site.axes.map(|axis| arm.cross(&axis)),
                _ => site.axes,
            };
            for (row, turn) in own.iter_mut().zip(&turns) {
                let response = body.inverse_inertia * turn;
                for (entry, turn) in row.iter_mut().zip(&turns) {
                    *entry += response.dot(turn);
                }
            }
            if matches!(side, Side::Object(..)) {
                (0..3).for_each(|axis| own[axis][axis] += body.inverse_mass * site.squares[axis]);
            }
        }
        let reduced = &self.reduced[index * self.n..][..self.n];
        for &k in &self.support[index * self.n..][..self.supported[index]] {
            let column = &reduced[k as usize];
            for (row, a) in own.iter_mut().zip(column) {
                for (entry, b) in row.iter_mut().zip(column) {
                    *entry += a * b;
                }
            }
        }
        own
    }

    /// Returns the W block between two contact points. Each has a place in the rows over the objects.
    fn block(&self, (local, index): (usize, usize), (place, other): (usize, usize)) -> [[f64; 4]; 3] {
        let n = self.n;
        let mut block = [[0.0; 4]; 3];
        let shorter = if self.supported[index] <= self.supported[other] { index } else { other };
        let (a, b) = (&self.reduced[index * n..][..n], &self.reduced[other * n..][..n]);
        for &k in &self.support[shorter * n..][..self.supported[shorter]] {
            let (a, b) = (&a[k as usize], &b[k as usize]);
            for (entries, a) in block.iter_mut().zip(a) {
                for (entry, b) in entries.iter_mut().zip(b) {
                    *entry += a * b;
                }
            }
        }
        let object = |local: usize, side: usize| self.rows[3 * local][side].map(|row: ObjectRow| row.object);
        for a in 0..2 {
            for b in 0..2 {
                if object(local, a).is_none() || object(local, a) != object(place, b) {
                    continue;
                }
                for (part, entries) in block.iter_mut().enumerate() {
                    for (column, entry) in entries[..3].iter_mut().enumerate() {
                        if let (Some(a), Some(b)) =
                            (&self.rows[3 * local + part][a], &self.rows[3 * place + column][b])
                        {
                            *entry += a.response.0.dot(&b.linear) + a.response.1.dot(&b.angular);
                        }
                    }
                }
            }
        }
        block
    }
}
