//! The impulses at all contact points of a step, found together.

use motorium_robots::MassFactor;
use nalgebra::Vector3;

use super::colliders::Owner;
use super::cone::ConeSolver;
use super::detect::ContactPoint;
use super::objects::FreeBody;
use crate::articulated::ExternalImpulses;

/// Overlap decays at this rate \[1/s\].
const RECOVERY_RATE: f64 = 50.0;

/// And no faster than this \[m/s\].
const FASTEST_RECOVERY: f64 = 0.5;

/// Smallest mobility of a contact point (its diagonal entry of W) relative to that of a free body of the robot's
/// mass. Below it the joints hold the point, which needs no impulse.
const IMMOVABLE: f64 = 1e-9;

/// Contact impulses of one step over the Delassus matrix `W = J A^-1 J'`.
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
    /// Columns of J over the robot's velocity, n for each contact point: entries of the normal and of two tangents.
    jacobian: Vec<[f64; 4]>,
    /// The same after half a solution with A: `W = Y' Y`.
    reduced: Vec<[f64; 4]>,
    /// Columns that are not zero, up to n for each contact point, and their number.
    support: Vec<u32>,
    supported: Vec<usize>,
    marked: Vec<bool>,
    /// Rows of J over the velocities of free objects: of the first and of the second collider of the contact point.
    objects: Vec<[Option<ObjectRow>; 2]>,
    directions: Vec<Vector3<f64>>,
    /// Velocities that the objects' fall alone gives.
    falling: Vec<f64>,
    target: Vec<f64>,
    /// Per contact point: the surfaces overlap, so that the target is a speed of recovery.
    overlapping: Vec<bool>,
    /// Inverse of the robot's mass \[1/kg\].
    inverse_mass: f64,
    /// Half the solution for all impulses (nv).
    sum: Vec<f64>,
    cone: ConeSolver,
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

/// Inverse of a mass \[1/kg\], of none at all a great number.
fn inverse(mass: f64) -> f64 {
    1.0 / mass.max(f64::MIN_POSITIVE)
}

impl Impulses {
    /// For a robot of `n` velocities and of `mass` \[kg\], and up to `most` contact points.
    pub(crate) fn new(n: usize, mass: f64, most: usize) -> Self {
        let rows = 3 * most;
        Self {
            n,
            points: 0,
            jacobian: vec![[0.0; 4]; most * n],
            reduced: vec![[0.0; 4]; most * n],
            support: vec![0; most * n],
            supported: vec![0; most],
            marked: vec![false; n],
            objects: vec![[None; 2]; rows],
            directions: vec![Vector3::zeros(); rows],
            falling: vec![0.0; rows],
            target: vec![0.0; most],
            overlapping: vec![false; most],
            inverse_mass: inverse(mass),
            sum: vec![0.0; n],
            cone: ConeSolver::new(most),
            keys: Vec::with_capacity(most),
            last: Vec::with_capacity(most),
        }
    }

    /// Takes over another mass of the robot \[kg\].
    pub(crate) fn set_mass(&mut self, mass: f64) {
        self.inverse_mass = inverse(mass);
    }

    /// Forgets the last step.
    pub(crate) fn forget(&mut self) {
        self.points = 0;
        self.keys.clear();
        self.last.clear();
    }

    /// The impulses of the last step by the keys of their contact points: what the next begins with.
    pub(crate) fn save(&self) -> Vec<(u64, [f64; 3])> {
        let impulse = |index: usize| [0, 1, 2].map(|part| self.cone.lambda[3 * index + part]);
        self.keys.iter().enumerate().map(|(index, key)| (*key, impulse(index))).collect()
    }

    /// Goes back to saved impulses.
    pub(crate) fn restore(&mut self, impulses: &[(u64, [f64; 3])]) {
        self.forget();
        self.points = impulses.len();
        for (index, (key, impulse)) in impulses.iter().enumerate() {
            self.keys.push(*key);
            self.cone.lambda[3 * index..][..3].copy_from_slice(impulse);
        }
    }

    /// Impulse at contact point `index` along its normal \[Ns\].
    pub(crate) fn normal(&self, index: usize) -> f64 {
        self.cone.lambda[3 * index]
    }

    /// Impulse at contact point `index` on the first of its two colliders, world axes \[Ns\].
    pub(crate) fn vector(&self, index: usize) -> Vector3<f64> {
        (3 * index..3 * index + 3).map(|row| self.directions[row] * self.cone.lambda[row]).sum()
    }

    /// Sets up the contact points of a step of `h` \[s\]. `slopes(owner, point, axes, sign, columns)` adds to `columns`
    /// (nv) `sign` times the Jacobian of the velocities along the three axes of the robot's part there; `v` (nv) is the
    /// robot's velocity now, `before` and `falling` the objects' now and after falling for the step.
    pub(crate) fn prepare(
        &mut self,
        points: &[ContactPoint],
        h: f64,
        v: &[f64],
        (before, falling): (&[FreeBody], &[FreeBody]),
        slopes: impl Fn(Owner, &ContactPoint, &[Vector3<f64>; 3], f64, &mut [[f64; 4]]),
    ) {
        self.last.clear();
        for (index, key) in self.keys.iter().enumerate() {
            let lambda = [0, 1, 2].map(|part| self.cone.lambda[3 * index + part]);
            self.last.push((*key, lambda));
        }
        self.keys.clear();
        self.points = points.len();
        let n = self.n;
        for (index, point) in points.iter().enumerate() {
            let (one, other) = tangents(&point.normal);
            let axes = [point.normal, one, other];
            let columns = &mut self.jacobian[index * n..][..n];
            columns.fill([0.0; 4]);
            slopes(point.owners.0, point, &axes, 1.0, columns);
            slopes(point.owners.1, point, &axes, -1.0, columns);
            for (part, direction) in axes.into_iter().enumerate() {
                let row = 3 * index + part;
                self.directions[row] = direction;
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
            self.cone.lambda[3 * index..][..3].copy_from_slice(&warm);
            self.cone.friction[index] = point.friction;
            let columns = self.jacobian[index * n..][..n].iter();
            let now = columns.zip(v).map(|(column, v)| column[0] * v).sum::<f64>()
                + speed(&self.objects[3 * index], before);
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
                bodies[part.object].linear += part.response.0 * self.cone.lambda[row];
                bodies[part.object].angular += part.response.1 * self.cone.lambda[row];
            }
        }
    }

    /// The Delassus matrix, the velocities without impulses and the targets.
    fn assemble(&mut self, factor: &MassFactor, held: &[bool], x: &[f64]) {
        let rows = 3 * self.points;
        for index in 0..self.points {
            self.reduce(index, factor, held, x);
            for other in 0..=index {
                let block = self.block(index, other);
                for (part, entries) in block.iter().enumerate() {
                    for (column, entry) in entries[..3].iter().enumerate() {
                        self.cone.delassus[(3 * index + part) * rows + 3 * other + column] = *entry;
                        self.cone.delassus[(3 * other + column) * rows + 3 * index + part] = *entry;
                    }
                }
            }
            let stiff = self.cone.delassus[3 * index * rows + 3 * index];
            let share =
                if self.overlapping[index] { (stiff / self.inverse_mass).min(1.0).sqrt() } else { 1.0 };
            self.cone.target[index] = share * self.target[index];
            self.cone.immovable[index] = stiff < IMMOVABLE * self.inverse_mass;
        }
    }

    /// Half a solution for contact point `index`, and its velocity without impulses.
    fn reduce(&mut self, index: usize, factor: &MassFactor, held: &[bool], x: &[f64]) {
        let n = self.n;
        let own = &self.jacobian[index * n..][..n];
        let reduced = &mut self.reduced[index * n..][..n];
        let mut velocity = [0.0; 4];
        let mut touches = false;
        for (k, column) in own.iter().enumerate() {
            let moves = *column != [0.0; 4];
            self.marked[k] = moves;
            touches |= moves;
            if moves {
                for (velocity, entry) in velocity.iter_mut().zip(column) {
                    *velocity += entry * x[k];
                }
            }
            reduced[k] = if held[k] { [0.0; 4] } else { *column };
        }
        let rows = 3 * index..3 * index + 3;
        let falling = &self.falling[rows.clone()];
        for ((sum, velocity), falling) in self.cone.velocity[rows].iter_mut().zip(velocity).zip(falling) {
            *sum = velocity + falling;
        }
        self.supported[index] = 0;
        if touches {
            factor.mark_carriers(&mut self.marked);
            let support = &mut self.support[index * n..][..n];
            for k in (0..n).filter(|k| self.marked[*k]) {
                support[self.supported[index]] = k as u32;
                self.supported[index] += 1;
            }
            factor.half_solve(&support[..self.supported[index]], reduced);
        }
    }

    /// The block of W between two contact points.
    fn block(&self, index: usize, other: usize) -> [[f64; 4]; 3] {
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
        let object = |point: usize, side: usize| self.objects[3 * point][side].map(|row| row.object);
        for a in 0..2 {
            for b in 0..2 {
                if object(index, a).is_none() || object(index, a) != object(other, b) {
                    continue;
                }
                for (part, entries) in block.iter_mut().enumerate() {
                    for (column, entry) in entries[..3].iter_mut().enumerate() {
                        if let (Some(a), Some(b)) =
                            (&self.objects[3 * index + part][a], &self.objects[3 * other + column][b])
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

/// The contact impulses as external impulses of the robot's step.
pub(crate) struct ContactResponse<'a>(pub(crate) &'a mut Impulses);

impl ExternalImpulses for ContactResponse<'_> {
    fn apply(&mut self, factor: &MassFactor, held: &[bool], x: &mut [f64], impulse: &mut [f64]) {
        let impulses = &mut *self.0;
        if impulses.points == 0 {
            return;
        }
        impulses.assemble(factor, held, x);
        impulses.cone.solve(impulses.points);
        let n = impulses.n;
        impulses.sum.fill(0.0);
        for index in 0..impulses.points {
            let lambda = &impulses.cone.lambda[3 * index..][..3];
            if lambda == [0.0; 3] {
                continue;
            }
            let times = |column: &[f64; 4]| column.iter().zip(lambda).map(|(a, b)| a * b).sum::<f64>();
            for &k in &impulses.support[index * n..][..impulses.supported[index]] {
                let k = k as usize;
                impulses.sum[k] += times(&impulses.reduced[index * n + k]);
                impulse[k] += times(&impulses.jacobian[index * n + k]);
            }
        }
        factor.finish_solve(&mut impulses.sum);
        for (x, sum) in x.iter_mut().zip(&impulses.sum) {
            *x += sum;
        }
    }
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
