//! Impacts with friction: Newton's law of restitution, bounded by the energy.
//!
//! Newton's law determines only the rebound speed. If friction turns a body in an off-centre impact, the law
//! may demand more energy than the impact has absorbed. The impulses of such an impact are therefore
//! interpolated between a plastic impact, without restitution, and Newton's: as far towards Newton's as two
//! bounds allow. By Stronge's energetic law (W. J. Stronge, Impact Mechanics, 2000, chapter 3), the normal
//! impulses of the rebound return at most the squared coefficient of restitution of the energy that they
//! absorbed. In addition, the kinetic energy does not rise. Friction cones are convex: they contain both ends
//! and everything in between.

use core::ops::Range;

use nalgebra::Vector3;

use super::super::site::{Side, Site};
use super::Impulses;
use super::rebound::Rebound;

/// Differences of a bound below this fraction of its energies count as rounding.
const ROUNDING: f64 = 1e-6;

impl Impulses {
    /// Returns `true` if an island has an impact in which friction may raise the energy.
    pub(super) fn bounces(&self, places: Range<usize>) -> bool {
        let mut sites = places.map(|place| &self.sites[self.islands.point(place)]);
        sites.any(|site| site.bounce > 0.0 && site.friction > 0.0)
    }

    /// Bounds the rebound of an island after a solution by Newton's law.
    pub(super) fn bound_rebound(&mut self, places: Range<usize>, robot: bool) {
        let mut impact = core::mem::take(&mut self.impact);
        let [lambda, velocity] = &mut impact.newton;
        self.find_velocities(places.clone(), velocity);
        for index in places.clone().map(|place| self.islands.point(place)) {
            lambda[3 * index..][..3].copy_from_slice(&self.lambda[3 * index..][..3]);
            let site = &mut self.sites[index];
            if site.bounce > 0.0 {
                site.target = 0.0;
            }
        }
        self.solve_points(places.clone(), robot);
        self.find_velocities(places.clone(), &mut impact.plastic);
        let share = self.rebound_share(places.clone(), &impact);
        for index in places.map(|place| self.islands.point(place)) {
            for at in 3 * index..3 * index + 3 {
                let [newton, plastic] = [impact.newton[0][at], self.lambda[at]];
                self.lambda[at] = if share < 1.0 { plastic + (newton - plastic) * share } else { newton };
            }
            let site = &mut self.sites[index];
            if site.bounce > 0.0 {
                site.target = site.bounce;
            }
        }
        self.impact = impact;
    }

    /// Returns the interpolation factor from the plastic impact, whose impulses are the current ones, to
    /// Newton's.
    fn rebound_share(&self, places: Range<usize>, impact: &Rebound) -> f64 {
        let [newton, newton_velocity] = &impact.newton;
        // Twice the energies: at the plastic impact, with slope and curvature of the interpolation.
        let (mut start, mut slope, mut curve, mut size) = (0.0, 0.0, 0.0, 0.0);
        // Stronge's bound of the squared factor.
        let (mut allowed, mut returned) = (0.0, 0.0);
        for index in places.map(|place| self.islands.point(place)) {
            let site = &self.sites[index];
            for axis in 0..3 {
                let at = 3 * index + axis;
                let (plastic, change) = (self.lambda[at], newton[at] - self.lambda[at]);
                let velocity = impact.plastic[at];
                start += plastic * (velocity + site.free[axis]);
                size += (plastic * velocity).abs() + (plastic * site.free[axis]).abs();
                slope += 2.0 * change * velocity;
                curve += change * (newton_velocity[at] - velocity);
            }
            if site.bounce > 0.0 {
                allowed += site.restitution * site.bounce * self.lambda[3 * index];
                returned += site.bounce * (newton[3 * index] - self.lambda[3 * index]);
            }
        }
        let mut share = 1.0_f64;
        if returned > allowed * (1.0 + ROUNDING) {
            share = (allowed / returned).max(0.0).sqrt();
        }
        let room = (-start).max(0.0);
        let excess = |share: f64| (slope + curve * share) * share - room;
        if excess(share) > ROUNDING * size && curve > 0.0 {
            share = share.min((-slope + (slope * slope + 4.0 * curve * room).sqrt()) / (2.0 * curve));
        }
        share.max(0.0)
    }

    /// Computes the velocities at the points of an island with the current impulses.
    fn find_velocities(&mut self, places: Range<usize>, velocities: &mut [f64]) {
        let Self { n, sites, lambda, bodies, reduced, support, supported, sum, islands, .. } = self;
        let (n, sites, lambda) = (*n, &*sites, &*lambda);
        let (reduced, support, supported) = (&*reduced, &*support, &*supported);
        let islands = &*islands;
        let points = || places.clone().map(move |place| islands.point(place));
        let rows = |index: usize| {
            let support = &support[index * n..][..supported[index]];
            support.iter().map(move |k| (*k as usize, &reduced[index * n + *k as usize]))
        };
        let objects = |site: &Site| site.sides.map(Side::object).into_iter().flatten();
        sum.fill(0.0);
        for object in points().flat_map(|index| objects(&sites[index])) {
            let body = &mut bodies[object];
            (body.linear, body.angular) = (Vector3::zeros(), Vector3::zeros());
        }
        for index in points() {
            let own = &lambda[3 * index..][..3];
            let vector = sites[index].vector(own);
            for (side, sign) in sites[index].sides.iter().zip([1.0, -1.0]) {
                if let Some(object) = side.object() {
                    bodies[object].take(side, &(vector * sign));
                }
            }
            for (k, row) in rows(index) {
                sum[k] += row[0] * own[0] + row[1] * own[1] + row[2] * own[2];
            }
        }
        for index in points() {
            let site = &sites[index];
            let of = |side: &Side| match side {
                Side::Object(object, arm) => bodies[*object].velocity_at(arm),
                Side::Turned(object) => bodies[*object].angular,
                Side::World | Side::Articulation(_) => Vector3::zeros(),
            };
            let relative = of(&site.sides[0]) - of(&site.sides[1]);
            for axis in 0..3 {
                let response: f64 = rows(index).map(|(k, row)| row[axis] * sum[k]).sum();
                velocities[3 * index + axis] = site.free[axis] + site.axes[axis].dot(&relative) + response;
            }
        }
    }
}
