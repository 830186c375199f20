//! Detection of steps in which nothing can touch, from the motion of the joints alone.

use motorium_robots::{JointKind, Model};

use super::bounds::{FORESIGHT, Motions, margin};
use super::colliders::{Collider, Owner};
use super::near_pairs::{NearPairs, SKIN};
use super::pair::Pair;
use super::parties::Least;
use crate::robot::Articulation;

/// Number of detections without a look-ahead after a look-ahead that saved no detection.
const PAUSE: u32 = 16;

/// Bounds on the distances that the robots' colliders have travelled since the pairs were last inspected,
/// derived from the motion of the joints.
///
/// A revolute joint moves its descendants by at most its angle times their distance from its origin. This
/// distance is at most the length of the links in between. Until the joints between two colliders have used
/// up the distance between them, nothing touches, and no collider pose is needed.
#[derive(Clone, Debug)]
pub(super) struct Calm {
    trees: Vec<Tree>,
    /// One entry per collider; `None` for colliders fixed in the world.
    places: Vec<Option<Place>>,
    watched: Vec<Watched>,
    /// Longest distance a collider travelled between the listing of near pairs and the last look-ahead \[m\].
    way: f64,
    /// Smallest distance within which contact points are found \[m\].
    least: f64,
    known: bool,
    /// Steps since the last look-ahead, and detections until the next one.
    steps: u32,
    wait: u32,
}

/// The joints of an articulation.
#[derive(Clone, Debug)]
struct Tree {
    floating: bool,
    /// The base, then the bodies.
    links: Vec<Link>,
    /// Configuration at the last look-ahead.
    q: Vec<f64>,
    /// Motion of the base in the world, and of all links relative to the base.
    base: Bound,
    bounds: Vec<Bound>,
}

#[derive(Clone, Copy, Debug)]
struct Link {
    parent: usize,
    column: usize,
    multiplier: f64,
    prismatic: bool,
    /// Distance of its origin from its parent's origin at the last look-ahead \[m\].
    length: f64,
}

/// Bounds of the motion of a link: changes since the last look-ahead, and current rates.
#[derive(Clone, Copy, Debug, Default)]
struct Bound {
    /// Angle \[rad\] and its rate \[rad/s\].
    turn: [f64; 2],
    /// Distance travelled by its origin \[m\] and speed \[m/s\].
    way: [f64; 2],
    /// Distance along the links from the origin of the base \[m\].
    depth: f64,
}

/// The attachment of a collider: its articulation, its link, and the distance of its farthest point from the
/// link origin \[m\].
#[derive(Clone, Copy, Debug)]
struct Place {
    tree: usize,
    link: usize,
    reach: f64,
}

/// A pair that may approach each other.
#[derive(Clone, Copy, Debug)]
struct Watched {
    colliders: [usize; 2],
    /// The last link that carries both colliders of one articulation.
    common: Option<usize>,
    /// Distance that the colliders may still use up \[m\].
    left: f64,
}

impl Calm {
    /// Creates the bounds for these articulations with room for `pairs` pairs of their colliders and others.
    pub(super) fn new(colliders: &[Collider], articulations: &[Articulation], pairs: usize) -> Self {
        let place = |collider: &Collider| {
            let (tree, link) = match collider.owner {
                Owner::Base(of) => (of, 0),
                Owner::Body(of, body) => (of, body + 1),
                Owner::World | Owner::Object(_) => return None,
            };
            let reach = collider.placement.translation.vector.norm() + collider.shape.bounding_radius();
            Some(Place { tree, link, reach })
        };
        Self {
            trees: articulations.iter().map(|own| Tree::new(own.model())).collect(),
            places: colliders.iter().map(place).collect(),
            watched: Vec::with_capacity(pairs),
            way: 0.0,
            least: 0.0,
            known: false,
            steps: 0,
            wait: 0,
        }
    }

    /// Discards all knowledge until the next look-ahead.
    pub(super) fn forget(&mut self) {
        (self.known, self.steps, self.wait) = (false, 0, 0);
    }

    /// Inspects the near pairs after a detection without contact points. Any other detection discards all
    /// knowledge.
    pub(super) fn look(
        &mut self,
        articulations: &[Articulation],
        q: &[f64],
        (pairs, near, motions): (&[Pair], &NearPairs, &Motions),
        (free, least): (bool, Least),
    ) {
        if self.known && self.steps == 0 {
            self.wait = PAUSE;
        }
        (self.known, self.steps) = (free && self.wait == 0, 0);
        self.wait = self.wait.saturating_sub(1);
        if !self.known {
            return;
        }
        for (tree, own) in self.trees.iter_mut().zip(articulations) {
            tree.look(own, &q[own.q()]);
        }
        (self.way, self.least) = (near.way(motions), least.robots.max(least.grasps));
        self.watched.clear();
        for pair in near.list().iter().map(|index| &pairs[*index as usize]) {
            let colliders = [pair.first, pair.second];
            let common = match colliders.map(|collider| self.places[collider]) {
                [Some(a), Some(b)] if a.tree == b.tree => Some(self.trees[a.tree].common(a.link, b.link)),
                _ => None,
            };
            let (way, _) = motions.of_pair(pair.part, pair.first, pair.second);
            let left = pair.until - way - (least.for_parties(pair.parties) - FORESIGHT).max(0.0);
            self.watched.push(Watched { colliders, common, left });
        }
    }

    /// Returns `true` if nothing can touch in a step of `h` \[s\] from this state of all articulations.
    /// `parts` selects the relevant [`Motions`].
    pub(super) fn holds(
        &mut self,
        articulations: &[Articulation],
        (q, v): (&[f64], &[f64]),
        (h, parts): (f64, [bool; 2]),
    ) -> bool {
        if !self.known {
            return false;
        }
        for (tree, own) in self.trees.iter_mut().zip(articulations) {
            tree.follow(&q[own.q()], &v[own.v()]);
        }
        let Self { trees, places, .. } = &*self;
        let (mut way, mut speed) = (0.0_f64, 0.0_f64);
        for place in places.iter().flatten() {
            let tree = &trees[place.tree];
            for common in
                [None, Some(0)].into_iter().zip(parts).filter_map(|(of, counts)| counts.then_some(of))
            {
                let [moved, rate] = tree.motion(place, common);
                (way, speed) = (way.max(moved), speed.max(rate));
            }
        }
        // Pairs that are not listed must not have come near.
        let far = 2.0 * (self.way + way) + margin(h, 2.0 * speed).max(self.least) < SKIN;
        let holds = far
            && self.watched.iter().all(|watched| {
                let mut left = watched.left;
                let mut speed = 0.0;
                for place in watched.colliders.iter().filter_map(|collider| places[*collider].as_ref()) {
                    let [moved, rate] = trees[place.tree].motion(place, watched.common);
                    (left, speed) = (left - moved, speed + rate);
                }
                left > margin(h, speed)
            });
        self.steps = self.steps.saturating_add(u32::from(holds));
        holds
    }
}

impl Tree {
    fn new(model: &Model) -> Self {
        let base = Link { parent: 0, column: 0, multiplier: 0.0, prismatic: false, length: 0.0 };
        let bodies = model.bodies().iter().map(|body| Link {
            parent: body.parent.map_or(0, |parent| parent + 1),
            column: body.joint.coordinate.index(),
            multiplier: body.joint.coordinate.multiplier(),
            prismatic: body.joint.kind == JointKind::Prismatic,
            length: 0.0,
        });
        let links: Vec<_> = [base].into_iter().chain(bodies).collect();
        Self {
            floating: model.base().floating,
            bounds: vec![Bound::default(); links.len()],
            base: Bound::default(),
            q: model.neutral(),
            links,
        }
    }

    fn look(&mut self, own: &Articulation, q: &[f64]) {
        self.q.copy_from_slice(q);
        let place = |link: usize| own.kinematics.body_position(link.checked_sub(1));
        for (index, link) in self.links.iter_mut().enumerate().skip(1) {
            link.length = (place(index) - place(link.parent)).norm();
        }
    }

    /// Returns the last link that carries both.
    fn common(&self, mut a: usize, mut b: usize) -> usize {
        while a != b {
            if a > b {
                a = self.links[a].parent;
            } else {
                b = self.links[b].parent;
            }
        }
        a
    }

    fn follow(&mut self, q: &[f64], v: &[f64]) {
        let (first, first_rate) = if self.floating { (7, 6) } else { (0, 0) };
        if self.floating {
            let squares = |numbers: &[f64]| numbers.iter().map(|number| number * number).sum::<f64>().sqrt();
            let apart = |range: core::ops::Range<usize>, sign: f64| {
                let differences = q[range.clone()].iter().zip(&self.q[range]);
                differences.map(|(now, then)| (now - sign * then).powi(2)).sum::<f64>().sqrt()
            };
            // The chord between two unit quaternions is twice the sine of a quarter of the angle.
            let chord = apart(3..7, 1.0).min(apart(3..7, -1.0));
            self.base = Bound {
                turn: [core::f64::consts::PI * chord, squares(&v[3..6])],
                way: [apart(0..3, 1.0), squares(&v[..3])],
                depth: 0.0,
            };
        }
        for (index, link) in self.links.iter().enumerate().skip(1) {
            let above = self.bounds[link.parent];
            let column = first + link.column;
            let change = (link.multiplier * (q[column] - self.q[column])).abs();
            let own = [change, (link.multiplier * v[first_rate + link.column]).abs()];
            let length = link.length + if link.prismatic { change } else { 0.0 };
            let mut bound = Bound { depth: above.depth + length, ..above };
            for ((way, turn), own) in bound.way.iter_mut().zip(&mut bound.turn).zip(own) {
                *way += *turn * length;
                *(if link.prismatic { way } else { turn }) += own;
            }
            self.bounds[index] = bound;
        }
    }

    /// Returns bounds of the distance travelled by any point of a collider \[m\] and of its speed \[m/s\],
    /// relative to a link that carries it, or in the world.
    #[inline]
    fn motion(&self, place: &Place, carrier: Option<usize>) -> [f64; 2] {
        let bound = &self.bounds[place.link];
        let from = carrier.map_or(Bound::default(), |carrier| self.bounds[carrier]);
        let (length, base) =
            (bound.depth - from.depth, if carrier.is_none() { self.base } else { Bound::default() });
        [0, 1].map(|kind| {
            let relative = bound.way[kind] - from.way[kind] - from.turn[kind] * length
                + (bound.turn[kind] - from.turn[kind]) * place.reach;
            relative + base.way[kind] + base.turn[kind] * (length + place.reach)
        })
    }
}
