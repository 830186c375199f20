//! The impulses at all contact points of a step, found together.

mod articulations;
mod assembly;
mod couples;
mod impact;
mod rebound;
mod sleeping;
mod turning;
mod warm;

use core::ops::Range;

use motorium_robots::MassFactor;
use motorium_worlds::Softness;
use nalgebra::{Point3, Vector3};

use super::colliders::Owner;
use super::cone::ConeSolver;
use super::islands::Islands;
use super::newton_room::{DENSE, DENSE_FREE};
use super::objects::FreeBody;
use super::point::ContactPoint;
use super::site::{Mobility, ObjectRow, Side, Site};
use super::sweeps::Room;
use crate::robot::{Articulation, Robot};
use rebound::Rebound;
use turning::add_turning;
pub(crate) use warm::Known;

/// Decay rate of penetration \[1/s\].
const RECOVERY_RATE: f64 = 50.0;

/// Largest recovery speed \[m/s\].
const FASTEST_RECOVERY: f64 = 0.5;

/// Smallest mobility of a contact point (its diagonal entry of W) relative to the mobility of free bodies
/// with the masses of both parties. Below this value the joints block the point, which needs no impulse.
const IMMOVABLE: f64 = 1e-9;

/// Contact impulses of one step over the Delassus matrix `W = J A^-1 J'`.
///
/// For each contact point with normal n and relative surface velocity w at the end of the step
///
/// ```text
/// 0 <= lambda_n  complementary to  w_n - target + compliance lambda_n >= 0
/// target = -distance / h, apart
/// w_t = 0 within, w_t = -s lambda_t on the edge of  |lambda_t| <= mu lambda_n
/// ```
///
/// Signorini's condition and Coulomb's law on velocities (Moreau 1988), with the exact cone instead of a
/// pyramid. Penetration decays at a fixed rate (Baumgarte 1972). No target exceeds 0.5 m/s or demands more
/// kinetic energy than the two parties have at that speed: recovery is slower at a point that joints hardly
/// allow to move. The impulses of the last step are the warm start. Surfaces that resist rolling or spinning
/// add [torques](couples), each with a separate bound that grows with `lambda_n`.
///
/// Surfaces with restitution rebound by [Newton's law](impact), bounded by the energy.
///
/// For a surface that yields like a spring and a damper, target and compliance follow from the force at the
/// end of the step.
///
/// A consists of blocks: the mass factor of each articulation, and the mass and inertia of each free object.
/// Contact points without a chain of blocks between them are in different [islands](Islands) and solved
/// separately: small islands over their matrix W, large ones [body by body](super::sweeps::Island). Islands
/// of medium size that rest are solved body by body first, and over W if that does not settle. Nothing
/// allocates after [`new`](Self::new).
#[derive(Clone, Debug)]
pub(crate) struct Impulses {
    /// Number of velocities of all articulations, and the range of each.
    n: usize,
    parts: Vec<Range<usize>>,
    sites: Vec<Site>,
    /// Columns of J over the articulations' velocities, n for each contact point: entries of the normal and
    /// of two tangents.
    jacobian: Vec<[f64; 4]>,
    /// Columns of J after half a solution with A: `W = Y' Y`.
    reduced: Vec<[f64; 4]>,
    /// Indices of nonzero columns, up to n for each contact point, and their number.
    support: Vec<u32>,
    supported: Vec<usize>,
    marked: Vec<bool>,
    /// The free objects.
    bodies: Vec<Mobility>,
    /// Velocities of the free objects without impulses.
    falling: Vec<FreeBody>,
    /// Rows of J over the free objects, three for each contact point of an island whose matrix is formed.
    rows: Vec<[Option<ObjectRow>; 2]>,
    /// Inverse mass of each articulation, including its armatures at an arm of 1 m \[1/kg\].
    inverse_masses: Vec<f64>,
    /// Half solution for all impulses (nv).
    sum: Vec<f64>,
    pub(super) lambda: Vec<f64>,
    room: Room,
    impact: Rebound,
    islands: Islands,
    /// True for islands that must be solved.
    pending: Vec<bool>,
    cone: ConeSolver,
    /// Keys of the contact points, and the lengths of their integration steps \[s\].
    keys: Vec<(u64, f64)>,
    /// The impulses of the last integration step.
    last: Vec<Known>,
}

/// An articulation as a target of impulses.
pub(crate) struct ImpulseTarget<'a> {
    /// Factor of the matrix that maps velocities to impulses.
    pub(crate) factor: &'a MassFactor,
    /// Entries with a fixed velocity: no impulse changes them.
    pub(crate) held: &'a [bool],
    /// End velocity without impulses; their effect is added.
    pub(crate) x: &'a mut [f64],
    /// Generalized impulse, initially zero; impulses are added.
    pub(crate) impulse: &'a mut [f64],
}

/// An articulation that contact impulses act on.
pub(crate) trait MovedByImpulses {
    /// Returns its end velocity and the map from impulses to it.
    fn target(&mut self) -> ImpulseTarget<'_>;
}

impl Impulses {
    /// Creates a workspace for these articulations, `objects` free objects and up to `most` contact points.
    pub(crate) fn new(robot: &Robot, objects: usize, most: usize) -> Self {
        let articulations = &robot.articulations;
        let n = articulations.last().map_or(0, |last| last.v().end);
        let mut impulses = Self {
            n,
            parts: articulations.iter().map(Articulation::v).collect(),
            sites: Vec::with_capacity(most),
            jacobian: vec![[0.0; 4]; most * n],
            reduced: vec![[0.0; 4]; most * n],
            support: vec![0; most * n],
            supported: vec![0; most],
            marked: vec![false; n],
            bodies: Vec::with_capacity(objects),
            falling: Vec::with_capacity(objects),
            rows: vec![[None; 2]; 3 * DENSE],
            inverse_masses: Vec::new(),
            sum: vec![0.0; n],
            lambda: vec![0.0; 3 * most],
            room: Room::new(most, n, objects),
            impact: Rebound::default(),
            islands: Islands::new(articulations.len() + objects, most),
            pending: Vec::with_capacity(most),
            cone: ConeSolver::new(most.min(DENSE)),
            keys: Vec::with_capacity(most),
            last: Vec::with_capacity(most),
        };
        impulses.impact.make_room(most);
        impulses.set_masses(robot);
        impulses
    }

    /// Reserves space for this number of contact points.
    pub(crate) fn make_room(&mut self, most: usize) {
        let n = self.n;
        self.sites.reserve(most);
        self.jacobian.resize(most * n, [0.0; 4]);
        self.reduced.resize(most * n, [0.0; 4]);
        self.support.resize(most * n, 0);
        self.supported.resize(most, 0);
        self.lambda.resize(3 * most, 0.0);
        self.room = Room::new(most, n, self.bodies.capacity());
        self.impact.make_room(most);
        self.islands.make_room(most);
        self.pending.reserve(most);
        self.keys.reserve(most);
        self.last.reserve(most);
    }

    /// Updates the masses of the articulations.
    pub(crate) fn set_masses(&mut self, robot: &Robot) {
        self.inverse_masses.clear();
        self.inverse_masses.extend(robot.articulations.iter().map(|own| {
            let armatures: f64 = robot.joints[own.joints()].iter().map(|joint| joint.armature).sum();
            inverse(own.model().mass() + armatures)
        }));
    }

    /// Clears the last step.
    pub(crate) fn forget(&mut self) {
        self.sites.clear();
        self.keys.clear();
        self.last.clear();
    }

    fn impulse(&self, index: usize) -> [f64; 3] {
        [0, 1, 2].map(|part| self.lambda[3 * index + part])
    }

    /// Returns the impulse at contact point `index` along its normal \[Ns\].
    pub(crate) fn normal(&self, index: usize) -> f64 {
        self.lambda[3 * index]
    }

    /// Returns the impulse at contact point `index` on the first of its two colliders, world axes \[Ns\].
    pub(crate) fn at_contact(&self, index: usize, point: &ContactPoint) -> Vector3<f64> {
        self.vector(index, &point.law.axes(&point.normal))
    }

    /// Returns the impulse with this index along its axes.
    fn vector(&self, index: usize, axes: &[Vector3<f64>; 3]) -> Vector3<f64> {
        (0..3).map(|part| axes[part] * self.lambda[3 * index + part]).sum()
    }

    /// Sets up the contact points of a step. `slopes(owner, point, axes, sign, columns)` adds `sign` times
    /// the Jacobian of the owner's velocities at the point, along the three axes, to `columns` (nv of an
    /// articulation). `v` (nv) are the current velocities of the articulations. `before` and `falling` are
    /// the objects' velocities now and after free fall during the step.
    pub(crate) fn prepare(
        &mut self,
        points: &[ContactPoint],
        v: &[f64],
        (before, falling): (&[FreeBody], &[FreeBody]),
        slopes: impl Fn(Owner, &Point3<f64>, &[Vector3<f64>; 3], f64, &mut [[f64; 4]]),
    ) {
        let mut last = core::mem::take(&mut self.last);
        last.clear();
        last.extend(self.known());
        self.last = last;
        self.keys.clear();
        self.sites.clear();
        self.falling.clear();
        self.falling.extend_from_slice(falling);
        self.bodies.clear();
        if !points.is_empty() {
            self.bodies.extend(falling.iter().map(Mobility::new));
        }
        let n = self.n;
        // The order of the points hardly changes from step to step.
        let mut expected = 0;
        for (index, point) in points.iter().enumerate() {
            let h = point.h;
            let (warm, place) = self.of_last(point.key, h, expected);
            expected = place.map_or(expected, |place| (place + 1) % self.last.len());
            self.keys.push((point.key, h));
            self.lambda[3 * index..][..3].copy_from_slice(&warm);
            if point.kept {
                self.sites.push(Site::KEPT);
                continue;
            }
            let mut site = match &point.held {
                Some(held) => Site::held(point, held, h, falling),
                None => Site::new(point, falling),
            };
            let turning = point.held.is_some_and(|held| held.turning);
            let columns = &mut self.jacobian[index * n..][..n];
            for of in site.articulations() {
                columns[self.parts[of].clone()].fill([0.0; 4]);
            }
            for (owner, sign) in [(point.owners.0, 1.0), (point.owners.1, -1.0)] {
                let Some(of) = owner.articulation() else { continue };
                let columns = &mut columns[self.parts[of].clone()];
                if turning {
                    add_turning(&slopes, (owner, sign), &point.point, site.axes, columns);
                } else {
                    slopes(owner, &point.point, &site.axes, sign, columns);
                }
            }
            site.falling = [0, 1, 2].map(|axis| site.speed(axis, falling));
            if point.held.is_some() {
                self.sites.push(site);
                continue;
            }
            let mut now = 0.0;
            for of in site.articulations() {
                let part = self.parts[of].clone();
                now +=
                    columns[part.clone()].iter().zip(&v[part]).map(|(column, v)| column[0] * v).sum::<f64>();
            }
            now += site.speed(0, before);
            site.target = if let Some(Softness { stiffness, damping }) = point.law.soft {
                // Force at the end of the step: lambda / h = -stiffness (distance + h w) - damping w.
                // Separated surfaces have no damping.
                let gain = h * stiffness + if point.distance > 0.0 { 0.0 } else { damping };
                site.soft = 1.0 / (h * gain);
                -stiffness * point.distance / gain
            } else if point.distance + h * now < 0.0 && now * point.law.restitution < -0.01 {
                (site.restitution, site.bounce) = (point.law.restitution, -point.law.restitution * now);
                site.bounce
            } else if point.distance > 0.0 {
                -point.distance / h
            } else {
                site.overlapping = true;
                site.recovery = (-point.distance * RECOVERY_RATE).min(FASTEST_RECOVERY);
                site.recovery
            };
            self.sites.push(site);
        }
        self.prepare_couples(points, falling, slopes);
    }

    /// Sets the objects' velocities to the velocities with impulses.
    pub(crate) fn push_objects(&self, bodies: &mut [FreeBody]) {
        for (index, site) in self.sites.iter().enumerate() {
            let impulse = site.vector(&self.lambda[3 * index..]);
            for (side, sign) in site.sides.iter().zip([1.0, -1.0]) {
                let Some(object) = side.object() else { continue };
                let (mobility, body) = (&self.bodies[object], &mut bodies[object]);
                let moment = match side {
                    Side::Object(_, arm) => {
                        body.linear += impulse * (sign * mobility.inverse_mass);
                        arm.cross(&impulse)
                    }
                    _ => impulse,
                };
                body.angular += mobility.inverse_inertia * moment * sign;
            }
        }
    }

    /// Marks the island of an articulation to be solved again. Its articulations must then be at their
    /// velocities without impulses.
    pub(crate) fn solve_again(&mut self, articulation: usize) {
        if let Some(island) = self.islands.of_body(articulation) {
            self.pending[island] = true;
        }
    }

    /// Returns `true` if the island of an articulation must be solved.
    pub(crate) fn is_pending(&mut self, articulation: usize) -> bool {
        self.islands.of_body(articulation).is_some_and(|island| self.pending[island])
    }

    /// Solves the pending islands and moves their articulations.
    pub(crate) fn solve(&mut self, articulations: &mut [impl MovedByImpulses]) {
        for island in 0..self.islands.count() {
            if std::mem::take(&mut self.pending[island]) {
                self.solve_island(island, articulations);
            }
        }
    }

    fn solve_island(&mut self, island: usize, articulations: &mut [impl MovedByImpulses]) {
        let places = self.islands.places(island);
        for place in places.clone() {
            self.reduce(self.islands.point(place), articulations);
        }
        let robot = places
            .clone()
            .any(|place| self.sites[self.islands.point(place)].articulations().next().is_some());
        self.solve_points(places.clone(), robot);
        if self.bounces(places.clone()) {
            self.bound_rebound(places.clone(), robot);
        }
        self.move_articulations(places, articulations);
    }

    /// Solves an island, with or without a `robot`, for the targets of its points.
    fn solve_points(&mut self, places: Range<usize>, robot: bool) {
        if places.len() <= if robot { DENSE } else { DENSE_FREE } {
            self.solve_dense(places);
        } else {
            let rests = places.len() <= DENSE && self.rests(places.clone());
            if !self.solve_sparse(places.clone(), rests) && rests {
                self.solve_dense(places);
            }
        }
    }
}

/// Returns the inverse of a mass \[1/kg\], or a large number for a mass of zero.
fn inverse(mass: f64) -> f64 {
    1.0 / mass.max(f64::MIN_POSITIVE)
}
