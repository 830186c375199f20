//! Sleeping islands, and the events that wake them.

use core::ops::Range;

use super::super::colliders::Owner;
use super::super::objects::FreeBody;
use super::super::point::ContactPoint;
use super::super::site::Side;
use super::Impulses;

impl Impulses {
    /// Sorts contact points by island.
    pub(crate) fn sort(&mut self, points: &[ContactPoint]) {
        let articulations = self.parts.len();
        let of_points = points.iter().map(|point| bodies_of(point, articulations));
        let couples = points.iter().filter(|point| point.law.resists_turning());
        self.islands.find(of_points.chain(couples.map(|point| bodies_of(point, articulations))));
    }

    /// Finds the bodies of islands in which a robot is closer than `least` \[m\] to something that it may
    /// hold. Uses the points that were sorted last.
    pub(crate) fn find_near(&mut self, points: &[ContactPoint], least: f64, near: &mut [bool]) {
        self.pending.clear();
        self.pending.resize(self.islands.count(), false);
        let grasps =
            points.iter().enumerate().filter(|(_, point)| point.distance < least && point.is_grasp());
        for (index, _) in grasps {
            if let Some(island) = self.islands.island(index) {
                self.pending[island] = true;
            }
        }
        for (body, near) in near.iter_mut().enumerate() {
            *near = self.islands.of_body(body).is_some_and(|island| self.pending[island]);
        }
    }

    /// Sorts the points of an integration step by island, and wakes the objects of islands in which anything
    /// moves. `lengths` has the step length of each body, zero for bodies that do not move.
    pub(crate) fn wake(&mut self, points: &mut [ContactPoint], objects: &mut [FreeBody], lengths: &[f64]) {
        let articulations = self.parts.len();
        self.sort(points);
        self.pending.clear();
        self.pending.resize(self.islands.count(), false);
        let moves = |body: usize, objects: &[FreeBody]| {
            let awake = body.checked_sub(articulations).is_none_or(|object| !objects[object].asleep);
            awake && lengths[body] > 0.0
        };
        for point in &*points {
            for body in bodies_of(point, articulations).into_iter().flatten() {
                if let (true, Some(island)) = (moves(body, objects), self.islands.of_body(body)) {
                    self.pending[island] = true;
                }
            }
        }
        for (object, body) in objects.iter_mut().enumerate().filter(|(_, body)| body.asleep) {
            let island = self.islands.of_body(articulations + object);
            // An object without contacts has no support.
            if island.is_none_or(|island| self.pending[island]) {
                body.wake();
            }
        }
        for (index, point) in points.iter_mut().enumerate() {
            if self.islands.island(index).is_some_and(|island| self.pending[island]) {
                point.kept = false;
                point.h = bodies_of(point, articulations)
                    .into_iter()
                    .flatten()
                    .fold(0.0, |most, body| lengths[body].max(most));
            }
        }
    }

    /// Returns `true` if the objects of an island hardly move, as in a stack.
    pub(super) fn rests(&self, places: Range<usize>) -> bool {
        places.flat_map(|place| self.sites[self.islands.point(place)].sides).all(|side| {
            side.object().is_none_or(|object| {
                let body = &self.falling[object];
                body.linear.norm_squared() < SLOW[0] * SLOW[0]
                    && body.angular.norm_squared() < SLOW[1] * SLOW[1]
            })
        })
    }

    /// Puts the objects of islands to sleep in which nothing has moved for long enough and which no robot
    /// touches.
    pub(crate) fn put_to_sleep(&mut self, bodies: &mut [FreeBody]) {
        for island in 0..self.islands.count() {
            let places = self.islands.places(island);
            let calm = places.clone().all(|place| {
                let site = &self.sites[self.islands.point(place)];
                let holds = site.couple.is_some_and(|couple| couple.holds);
                !holds
                    && site.sides.iter().all(|side| match side {
                        Side::World => true,
                        Side::Articulation(_) => false,
                        Side::Object(object, _) | Side::Turned(object) => bodies[*object].is_drowsy(),
                    })
            });
            if !calm {
                continue;
            }
            for place in places {
                for side in self.sites[self.islands.point(place)].sides {
                    if let Some(object) = side.object() {
                        bodies[object].sleep();
                    }
                }
            }
        }
    }
}

/// Objects slower than this may come to rest \[m/s, rad/s\]; otherwise the residual of the sweeps would keep
/// them moving.
const SLOW: [f64; 2] = [0.05, 0.5];

/// Returns the one or two moving bodies at a contact point, with articulations numbered before objects.
fn bodies_of(point: &ContactPoint, articulations: usize) -> [Option<usize>; 2] {
    let body = |owner: Owner| match owner {
        Owner::World => None,
        Owner::Base(of) | Owner::Body(of, _) => Some(of),
        Owner::Object(object) => Some(articulations + object),
    };
    [body(point.owners.0), body(point.owners.1)]
}
