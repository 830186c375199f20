//! The impulses at all contact points of a step, found together.

use motorium_robots::MassFactor;
use nalgebra::Vector3;

use super::colliders::Owner;
use super::detect::ContactPoint;
use super::objects::FreeBody;
use crate::articulated::ExternalImpulses;

/// Overlap decays at this rate \[1/s\].
const RECOVERY_RATE: f64 = 50.0;

/// And no faster than this \[m/s\].
const FASTEST_RECOVERY: f64 = 0.5;

/// Compliance of a contact point, relative to the diagonal of W. It makes the forces unique where a rigid robot stands
/// on more points than determine them.
const COMPLIANCE: f64 = 1e-6;

/// Smallest mobility of a contact point (its diagonal entry of W) relative to that of a free body of the robot's
/// mass. Below it the joints hold the point, which needs no impulse.
const IMMOVABLE: f64 = 1e-9;

/// Largest number of sweeps over all contact points.
const SWEEPS: usize = 200;

/// Change of a velocity \[m/s\] in a sweep below which the sweeps end.
const SETTLED: f64 = 1e-8;

/// Contact impulses of one step, by block Gauss-Seidel over the Delassus matrix `W = J A^-1 J'`.
///
/// For each contact point with normal n and relative velocity w of the surfaces at the end of the step
///
/// ```text
/// 0 <= lambda_n  complementary to  w_n - target + compliance lambda_n >= 0      target = -distance / h, apart
/// w_t = 0 within, w_t = -s lambda_t on the edge of  |lambda_t| <= mu lambda_n
/// ```
///
/// Signorini's condition and Coulomb's law on velocities (Moreau 1988), with the cone itself, not a pyramid. Overlap
/// decays at a rate (Baumgarte 1972) and no target demands more than 0.5 m/s, nor more kinetic energy than the
/// robot's mass has at that speed: where joints hardly let a point move, recovery is slower. The impulses of the last
/// step are the first guess. Nothing allocates after [`new`](Self::new).
#[derive(Clone, Debug)]
pub(crate) struct Impulses {
    n: usize,
    points: usize,
    /// Rows of J over the robot's velocity: the normal's, then two tangents', for each contact point.
    jacobian: Vec<f64>,
    /// Rows of `J A^-1`.
    reduced: Vec<f64>,
    /// Rows of J over the velocities of free objects: of the first and of the second collider of the contact point.
    objects: Vec<[Option<ObjectRow>; 2]>,
    directions: Vec<Vector3<f64>>,
    delassus: Vec<f64>,
    /// Relative velocities: without the impulses, then with them.
    velocity: Vec<f64>,
    /// Velocities that the objects' fall alone gives.
    falling: Vec<f64>,
    target: Vec<f64>,
    /// Per contact point: the surfaces overlap, so that the target is a speed of recovery.
    overlapping: Vec<bool>,
    /// Inverse of the robot's mass \[1/kg\].
    inverse_mass: f64,
    friction: Vec<f64>,
    lambda: Vec<f64>,
    keys: Vec<u64>,
    last: Vec<(u64, [f64; 3])>,
}

/// Row of the Jacobian over the velocity of a free object, and the same times the inverse of its inertia.
#[derive(Clone, Copy, Debug)]
struct ObjectRow {
    object: usize,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
    response: (Vector3<f64>, Vector3<f64>),
}

impl Impulses {
    /// For a robot of `n` velocities and of `mass` \[kg\], and up to `most` contact points.
    pub(crate) fn new(n: usize, mass: f64, most: usize) -> Self {
        let rows = 3 * most;
        Self {
            n,
            points: 0,
            jacobian: vec![0.0; rows * n],
            reduced: vec![0.0; rows * n],
            objects: vec![[None; 2]; rows],
            directions: vec![Vector3::zeros(); rows],
            delassus: vec![0.0; rows * rows],
            velocity: vec![0.0; rows],
            falling: vec![0.0; rows],
            target: vec![0.0; most],
            overlapping: vec![false; most],
            inverse_mass: 1.0 / mass.max(f64::MIN_POSITIVE),
            friction: vec![0.0; most],
            lambda: vec![0.0; rows],
            keys: Vec::with_capacity(most),
            last: Vec::with_capacity(most),
        }
    }

    /// Forgets the last step.
    pub(crate) fn forget(&mut self) {
        self.points = 0;
        self.keys.clear();
        self.last.clear();
    }

    /// Impulse at contact point `index` along its normal \[Ns\].
    pub(crate) fn normal(&self, index: usize) -> f64 {
        self.lambda[3 * index]
    }

    /// Impulse at contact point `index` on the first of its two colliders, world axes \[Ns\].
    pub(crate) fn vector(&self, index: usize) -> Vector3<f64> {
        (3 * index..3 * index + 3).map(|row| self.directions[row] * self.lambda[row]).sum()
    }

    /// Sets up the contact points of a step of `h` \[s\]. `slope(owner, point, direction, sign, row)` adds to `row`
    /// (nv) `sign` times the Jacobian of the velocity along `direction` of the robot's part there; `v` (nv) is the
    /// robot's velocity now, `before` and `falling` the objects' now and after falling for the step.
    pub(crate) fn prepare(
        &mut self,
        points: &[ContactPoint],
        h: f64,
        v: &[f64],
        (before, falling): (&[FreeBody], &[FreeBody]),
        mut slope: impl FnMut(Owner, &ContactPoint, &Vector3<f64>, f64, &mut [f64]),
    ) {
        self.last.clear();
        for (index, key) in self.keys.iter().enumerate() {
            let lambda = [0, 1, 2].map(|part| self.lambda[3 * index + part]);
            self.last.push((*key, lambda));
        }
        self.keys.clear();
        self.points = points.len();
        let n = self.n;
        for (index, point) in points.iter().enumerate() {
            let (one, other) = tangents(&point.normal);
            for (part, direction) in [point.normal, one, other].into_iter().enumerate() {
                let row = 3 * index + part;
                self.directions[row] = direction;
                let entries = &mut self.jacobian[row * n..][..n];
                entries.fill(0.0);
                slope(point.owners.0, point, &direction, 1.0, entries);
                slope(point.owners.1, point, &direction, -1.0, entries);
                let object = |owner: Owner, sign: f64| {
                    let Owner::Object(object) = owner else { return None };
                    let body = &falling[object];
                    let linear = direction * sign;
                    let angular = (point.point.coords - body.pose.translation.vector).cross(&linear);
                    let response = (linear / body.mass, body.inverse_inertia_times(&angular));
                    Some(ObjectRow { object, linear, angular, response })
                };
                self.objects[row] = [object(point.owners.0, 1.0), object(point.owners.1, -1.0)];
                self.falling[row] = speed(&self.objects[row], falling);
            }
            self.keys.push(point.key);
            let warm = self.last.iter().find(|(key, _)| *key == point.key).map_or([0.0; 3], |last| last.1);
            self.lambda[3 * index..][..3].copy_from_slice(&warm);
            self.friction[index] = point.friction;
            let now = dot(&self.jacobian[3 * index * n..][..n], v) + speed(&self.objects[3 * index], before);
            self.overlapping[index] = false;
            self.target[index] = if point.distance + h * now < 0.0 && now * point.restitution < -0.01 {
                -point.restitution * now
            } else if point.distance > 0.0 {
                -point.distance / h
            } else {
                self.overlapping[index] = true;
                (-point.distance * RECOVERY_RATE).min(FASTEST_RECOVERY)
            };
        }
    }

    /// Gives the objects the velocities that the impulses lead to.
    pub(crate) fn push_objects(&self, bodies: &mut [FreeBody]) {
        for row in 0..3 * self.points {
            for part in self.objects[row].iter().flatten() {
                bodies[part.object].linear += part.response.0 * self.lambda[row];
                bodies[part.object].angular += part.response.1 * self.lambda[row];
            }
        }
    }

    /// The Delassus matrix and the velocities without impulses.
    fn assemble(&mut self, factor: &MassFactor, held: &[bool], x: &[f64]) {
        let (n, rows) = (self.n, 3 * self.points);
        for row in 0..rows {
            let own = &self.jacobian[row * n..][..n];
            self.velocity[row] = dot(own, x) + self.falling[row];
            let reduced = &mut self.reduced[row * n..][..n];
            reduced.copy_from_slice(own);
            for (entry, held) in reduced.iter_mut().zip(held) {
                if *held {
                    *entry = 0.0;
                }
            }
            if reduced.iter().any(|entry| *entry != 0.0) {
                factor.solve(reduced);
            }
            for other in 0..=row {
                let mut entry = dot(reduced, &self.jacobian[other * n..][..n]);
                for a in self.objects[row].iter().flatten() {
                    for b in self.objects[other].iter().flatten().filter(|b| b.object == a.object) {
                        entry += a.response.0.dot(&b.linear) + a.response.1.dot(&b.angular);
                    }
                }
                self.delassus[row * rows + other] = entry;
                self.delassus[other * rows + row] = entry;
            }
        }
    }

    /// The target of contact point `index`, `stiff` being its diagonal entry of W.
    fn target(&self, index: usize, stiff: f64) -> f64 {
        let share = if self.overlapping[index] { (stiff / self.inverse_mass).min(1.0).sqrt() } else { 1.0 };
        share * self.target[index]
    }

    /// True when no impulse moves contact point `index`.
    fn is_immovable(&self, index: usize, rows: usize) -> bool {
        let row = 3 * index;
        self.delassus[row * rows + row] < IMMOVABLE * self.inverse_mass
    }

    /// Sweeps over the contact points until nothing changes.
    fn sweep(&mut self) {
        let rows = 3 * self.points;
        for index in 0..self.points {
            if self.is_immovable(index, rows) {
                self.lambda[3 * index..][..3].fill(0.0);
            }
        }
        for row in 0..rows {
            let pushes = &self.delassus[row * rows..][..rows];
            self.velocity[row] += dot(pushes, &self.lambda[..rows]);
        }
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for index in 0..self.points {
                change = change.max(self.relax(index, rows));
            }
            if change < SETTLED {
                break;
            }
        }
    }

    /// Solves one contact point for fixed impulses at the others. Returns the largest change of its velocity.
    fn relax(&mut self, index: usize, rows: usize) -> f64 {
        if self.is_immovable(index, rows) {
            return 0.0;
        }
        let at = 3 * index;
        let w = |row: usize, column: usize| self.delassus[(at + row) * rows + at + column];
        let stiff = w(0, 0);
        let old = [self.lambda[at], self.lambda[at + 1], self.lambda[at + 2]];
        let compliance = COMPLIANCE * stiff;
        let missing = self.velocity[at] - self.target(index, stiff) + compliance * old[0];
        let normal = (old[0] - missing / (stiff + compliance)).max(0.0);
        // Slip with the new normal impulse.
        let step = normal - old[0];
        let slip = [self.velocity[at + 1] + w(1, 0) * step, self.velocity[at + 2] + w(2, 0) * step];
        // Along a tangent that the joints hold, one of them may be zero.
        let soft = COMPLIANCE * w(1, 1).max(w(2, 2));
        let (a, b, c) = (w(1, 1) + soft, w(1, 2), w(2, 2) + soft);
        let bound = self.friction[index] * normal;
        let determinant = (a * c - b * b).max(f64::MIN_POSITIVE);
        let mut tangent = [
            old[1] - (c * slip[0] - b * slip[1]) / determinant,
            old[2] - (a * slip[1] - b * slip[0]) / determinant,
        ];
        let squared = |tangent: &[f64; 2]| tangent[0] * tangent[0] + tangent[1] * tangent[1];
        if squared(&tangent) > bound * bound {
            // It slips: a projected step along the slip, whose fixed point opposes it.
            let stiffest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
            tangent = [old[1] - slip[0] / stiffest, old[2] - slip[1] / stiffest];
            let size = squared(&tangent).sqrt();
            if size > bound {
                tangent = tangent.map(|part| part * bound / size);
            }
        }
        let new = [normal, tangent[0], tangent[1]];
        let mut change = 0.0_f64;
        for part in 0..3 {
            let step = new[part] - old[part];
            if step != 0.0 {
                self.lambda[at + part] = new[part];
                let pushes = &self.delassus[(at + part) * rows..][..rows];
                for (velocity, push) in self.velocity[..rows].iter_mut().zip(pushes) {
                    *velocity += push * step;
                }
                change = change.max((step * pushes[at + part]).abs());
            }
        }
        change
    }
}

/// The contact impulses as external impulses of the robot's step.
pub(crate) struct ContactResponse<'a>(pub(crate) &'a mut Impulses);

impl ExternalImpulses for ContactResponse<'_> {
    fn apply(&mut self, factor: &MassFactor, held: &[bool], x: &mut [f64], impulse: &mut [f64]) {
        let impulses = &mut *self.0;
        impulses.assemble(factor, held, x);
        impulses.sweep();
        let n = impulses.n;
        for row in 0..3 * impulses.points {
            let lambda = impulses.lambda[row];
            if lambda != 0.0 {
                let entries = impulses.jacobian[row * n..][..n].iter().zip(&impulses.reduced[row * n..][..n]);
                for ((x, impulse), (own, reduced)) in x.iter_mut().zip(&mut *impulse).zip(entries) {
                    *x += reduced * lambda;
                    *impulse += own * lambda;
                }
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn speed(parts: &[Option<ObjectRow>; 2], bodies: &[FreeBody]) -> f64 {
    let part = |row: &ObjectRow| {
        let body = &bodies[row.object];
        row.linear.dot(&body.linear) + row.angular.dot(&body.angular)
    };
    parts.iter().flatten().map(part).sum()
}

/// Two unit vectors square to `normal` and to one another. They are continuous in it except where the chosen axis
/// changes.
fn tangents(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let axis = if normal.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    let one = (axis - normal * normal.dot(&axis)).normalize();
    (one, normal.cross(&one))
}
