//! The solver of the contact problem: sweeps over the contact points, and Newton steps over all of them.

use super::answer::PointAnswer;
use super::newton_room::Newton;
use super::site::Couple;

/// Largest number of sweeps over all contact points.
const SWEEPS: usize = 200;

/// Change of a velocity \[m/s\] in a sweep below which the sweeps end.
const SETTLED: f64 = 1e-8;

/// A Newton step has diverged if the next sweep changes more than this multiple of the sweep before the step.
const ASTRAY: f64 = 1.0;

/// The contact problem of a step:
///
/// ```text
/// w = W lambda + w_free
/// 0 <= lambda_n  complementary to  w_n - target + compliance lambda_n >= 0      of soft surfaces with theirs
/// w_t = 0 within, w_t = -s lambda_t on the edge of  |lambda_t| <= mu lambda_n
/// ```
///
/// A sweep solves one contact point after the other (block Gauss-Seidel). It determines within a few rounds
/// which points are open, stick or slip, and then converges slowly if points are redundant, as under a flat
/// sole. A Newton step solves the equations of these modes for all points at once. The result of a Newton
/// step is kept if the next sweep hardly changes it. In either case a sweep confirms the final solution.
///
/// Torques against rolling and spinning are separate blocks of three rows each. Their `w` is an angular
/// velocity, and their bounds grow with the normal impulse of their contact point. Newton steps leave them to
/// the sweeps. Bilateral blocks have no bounds and are part of every Newton step.
#[derive(Clone, Debug)]
pub(crate) struct ConeSolver {
    /// Three times the number of contact points.
    pub(super) rows: usize,
    /// W, stored by rows: for each contact point the normal, then two tangents.
    pub(super) delassus: Vec<f64>,
    /// Velocities w: without impulses before [`solve`](Self::solve), with impulses after it.
    pub(super) velocity: Vec<f64>,
    /// One entry per contact point.
    pub(super) target: Vec<f64>,
    pub(super) friction: Vec<f64>,
    /// Approach speed per unit of impulse of compliant surfaces.
    pub(super) soft: Vec<f64>,
    /// True if no impulse moves the point.
    pub(super) immovable: Vec<bool>,
    /// Torques at contact points. Their blocks follow all contact points.
    pub(super) couples: Vec<Option<Couple>>,
    answers: Vec<PointAnswer>,
    /// For each point, the indices of the points that its impulse moves, itself included, in ascending order;
    /// the lists are concatenated.
    coupled: Vec<u32>,
    /// End of each point's list.
    ends: Vec<usize>,
    pub(super) lambda: Vec<f64>,
    pub(super) newton: Newton,
}

impl ConeSolver {
    /// Creates a solver for up to `most` contact points.
    pub(super) fn new(most: usize) -> Self {
        let rows = 3 * most;
        Self {
            rows: 0,
            delassus: vec![0.0; rows * rows],
            velocity: vec![0.0; rows],
            target: vec![0.0; most],
            friction: vec![0.0; most],
            soft: vec![0.0; most],
            immovable: vec![false; most],
            couples: vec![None; most],
            answers: vec![PointAnswer::NONE; most],
            coupled: Vec::with_capacity(most * most),
            ends: Vec::with_capacity(most),
            lambda: vec![0.0; rows],
            newton: Newton::new(most),
        }
    }

    /// Solves for the impulses `lambda` of `points` contact points, starting from their current values.
    pub(super) fn solve(&mut self, points: usize) {
        self.rows = 3 * points;
        let rows = self.rows;
        for index in 0..points {
            if self.immovable[index] {
                self.lambda[3 * index..][..3].fill(0.0);
            }
        }
        // W is symmetric, so its rows are its columns.
        for (row, lambda) in self.delassus.chunks_exact(rows.max(1)).zip(&self.lambda[..rows]) {
            if *lambda != 0.0 {
                for (velocity, entry) in self.velocity[..rows].iter_mut().zip(row) {
                    *velocity += entry * lambda;
                }
            }
        }
        for (index, answer) in self.answers.iter_mut().enumerate().take(points) {
            let at = 3 * index;
            let entry = |row: usize, column: usize| self.delassus[(at + row) * rows + at + column];
            let own = [0, 1, 2].map(|row| [0, 1, 2].map(|column| entry(row, column)));
            *answer = if self.couples[index].is_some() {
                PointAnswer::couple(&own)
            } else {
                PointAnswer::new(&own, self.soft[index])
            };
        }
        self.find_coupled();
        // Number of sweeps before the next Newton step; doubled whenever a step diverges.
        let (mut patience, mut wait) = (1, 1);
        let mut sweeps = 0;
        while sweeps < SWEEPS {
            let change = self.sweep();
            sweeps += 1;
            if change < SETTLED {
                return;
            }
            patience -= 1;
            if patience > 0 {
                continue;
            }
            self.newton.lambda[..rows].copy_from_slice(&self.lambda[..rows]);
            self.newton.velocity[..rows].copy_from_slice(&self.velocity[..rows]);
            let after = if self.newton_step() { self.sweep() } else { f64::INFINITY };
            sweeps += 1;
            if after < SETTLED {
                return;
            }
            patience = 1;
            if after.is_nan() || after > ASTRAY * change {
                self.lambda[..rows].copy_from_slice(&self.newton.lambda[..rows]);
                self.velocity[..rows].copy_from_slice(&self.newton.velocity[..rows]);
                wait *= 2;
                patience = wait;
            }
        }
    }

    /// Finds the points that each point moves: few in a pile of objects, all points on one robot.
    fn find_coupled(&mut self) {
        let (rows, points) = (self.rows, self.rows / 3);
        self.coupled.clear();
        self.ends.clear();
        for index in 0..points {
            let block = |other: usize| {
                (0..3).any(|part| {
                    self.delassus[(3 * index + part) * rows + 3 * other..][..3]
                        .iter()
                        .any(|entry| *entry != 0.0)
                })
            };
            self.coupled.extend((0..points as u32).filter(|other| block(*other as usize)));
            self.ends.push(self.coupled.len());
        }
    }

    /// Changes the impulse of `row` by `step`.
    pub(super) fn push(&mut self, row: usize, step: f64) {
        let (rows, index) = (self.rows, row / 3);
        self.lambda[row] += step;
        let pushes = &self.delassus[row * rows..][..rows];
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        let coupled = &self.coupled[start..self.ends[index]];
        if 2 * 3 * coupled.len() > rows {
            for (velocity, push) in self.velocity[..rows].iter_mut().zip(pushes) {
                *velocity += push * step;
            }
            return;
        }
        for &other in coupled {
            let at = 3 * other as usize;
            for (velocity, push) in self.velocity[at..at + 3].iter_mut().zip(&pushes[at..at + 3]) {
                *velocity += push * step;
            }
        }
    }

    /// Solves each contact point once. Returns the largest velocity change.
    fn sweep(&mut self) -> f64 {
        (0..self.rows / 3).fold(0.0_f64, |change, index| change.max(self.relax(index)))
    }

    /// Solves one contact point with the impulses at the other points fixed. Returns the largest change of
    /// its velocity.
    fn relax(&mut self, index: usize) -> f64 {
        if self.immovable[index] {
            return 0.0;
        }
        let at = 3 * index;
        let old = [self.lambda[at], self.lambda[at + 1], self.lambda[at + 2]];
        let velocity = [self.velocity[at], self.velocity[at + 1], self.velocity[at + 2]];
        let answer = &self.answers[index];
        let new = match self.couples[index] {
            Some(couple) => {
                answer.relax_couple(&old, &velocity, couple.bounds(self.lambda[3 * couple.point]))
            }
            None => answer.relax(&old, &velocity, (self.target[index], self.friction[index])),
        };
        let mut change = 0.0_f64;
        for part in 0..3 {
            let step = new[part] - old[part];
            if step != 0.0 {
                change = change.max((step * self.answers[index].diagonal[part]).abs());
                self.push(at + part, step);
            }
        }
        change
    }
}

impl Couple {
    /// Returns the largest moments about the normal and about the tangents at this normal impulse.
    #[inline]
    pub(super) fn bounds(&self, normal: f64) -> [f64; 2] {
        if self.holds {
            return [f64::INFINITY; 2];
        }
        [self.torsional * normal, self.rolling * normal]
    }
}

/// Returns the inner product of two vectors of equal length, computed in four parallel sums.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, last_of_a) = a.as_chunks::<4>();
    let (b, last_of_b) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f64 = last_of_a.iter().zip(last_of_b).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
