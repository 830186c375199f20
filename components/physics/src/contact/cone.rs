//! The solver of the contact problem: sweeps over the contact points, and Newton steps over all of them at once.

/// Compliance of a contact point, relative to the diagonal of W. It makes the forces unique where a rigid robot stands
/// on more points than determine them.
const COMPLIANCE: f64 = 1e-6;

/// Largest number of sweeps over all contact points.
const SWEEPS: usize = 200;

/// Change of a velocity \[m/s\] in a sweep below which the sweeps end.
const SETTLED: f64 = 1e-8;

/// A sweep that changes more than this multiple of the one before the Newton step shows that the step led astray.
const ASTRAY: f64 = 1.0;

/// Times that a Newton step opens points that would pull.
const OPENINGS: usize = 4;

/// Slower than this \[m/s\] a contact point on the edge of its cone counts as sticking.
const STANDING: f64 = 1e-9;

/// Most unknowns of a Newton step: beyond, sweeps cost less.
const MOST_UNKNOWNS: usize = 180;

/// The contact problem of a step:
///
/// ```text
/// w = W lambda + w_free
/// 0 <= lambda_n  complementary to  w_n - target + compliance lambda_n >= 0
/// w_t = 0 within, w_t = -s lambda_t on the edge of  |lambda_t| <= mu lambda_n
/// ```
///
/// A sweep solves one contact point after the other (block Gauss-Seidel): it finds which points are open, stick or slip
/// within a few rounds, and then converges slowly where points are redundant, as under a flat sole. A Newton step solves
/// the equations of these modes for all points at once. What a step finds is kept when the next sweep hardly changes it;
/// either way the solution is one that a sweep confirms.
#[derive(Clone, Debug)]
pub(crate) struct ConeSolver {
    /// Three times the number of contact points.
    rows: usize,
    /// W, rows by rows: the normal's, then two tangents', for each contact point.
    pub(super) delassus: Vec<f64>,
    /// w: without the impulses before [`solve`](Self::solve), with them after.
    pub(super) velocity: Vec<f64>,
    /// Per contact point.
    pub(super) target: Vec<f64>,
    pub(super) friction: Vec<f64>,
    /// No impulse moves the point.
    pub(super) immovable: Vec<bool>,
    /// The points that an impulse at each point moves, itself included, ascending, one list after the other.
    coupled: Vec<u32>,
    /// Where the list of each point ends.
    ends: Vec<usize>,
    pub(super) lambda: Vec<f64>,
    newton: Newton,
}

/// Workspace of the Newton steps.
#[derive(Clone, Debug)]
struct Newton {
    /// Rows of the unknowns.
    unknowns: Vec<usize>,
    /// Rows of the normals of points that are opened.
    opening: Vec<usize>,
    modes: Vec<Mode>,
    system: Vec<f64>,
    step: Vec<f64>,
    lambda: Vec<f64>,
    velocity: Vec<f64>,
}

/// The mode of a contact point that presses.
#[derive(Clone, Copy, Debug)]
enum Mode {
    /// Without friction: its normal is the only unknown.
    Smooth,
    Stick,
    /// Direction and speed of the slip.
    Slip([f64; 2], f64),
}

impl ConeSolver {
    /// For up to `most` contact points.
    pub(super) fn new(most: usize) -> Self {
        let rows = 3 * most;
        Self {
            rows: 0,
            delassus: vec![0.0; rows * rows],
            velocity: vec![0.0; rows],
            target: vec![0.0; most],
            friction: vec![0.0; most],
            immovable: vec![false; most],
            coupled: Vec::with_capacity(most * most),
            ends: Vec::with_capacity(most),
            lambda: vec![0.0; rows],
            newton: Newton {
                unknowns: Vec::with_capacity(rows),
                opening: Vec::with_capacity(most),
                modes: Vec::with_capacity(most),
                system: vec![0.0; MOST_UNKNOWNS * MOST_UNKNOWNS],
                step: vec![0.0; rows],
                lambda: vec![0.0; rows],
                velocity: vec![0.0; rows],
            },
        }
    }

    /// The impulses `lambda` of `points` contact points, from those they are now.
    pub(super) fn solve(&mut self, points: usize) {
        self.rows = 3 * points;
        let rows = self.rows;
        for index in 0..points {
            if self.immovable[index] {
                self.lambda[3 * index..][..3].fill(0.0);
            }
        }
        for row in 0..rows {
            self.velocity[row] += dot(&self.delassus[row * rows..][..rows], &self.lambda[..rows]);
        }
        self.find_coupled();
        // Sweeps before the next Newton step; they double whenever one leads astray.
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

    /// The points that each point moves: in a pile of objects few, between those of one robot all.
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
    fn push(&mut self, row: usize, step: f64) {
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

    /// Solves each contact point once. Returns the largest change of a velocity.
    fn sweep(&mut self) -> f64 {
        (0..self.rows / 3).fold(0.0_f64, |change, index| change.max(self.relax(index)))
    }

    /// Solves one contact point for fixed impulses at the others. Returns the largest change of its velocity.
    fn relax(&mut self, index: usize) -> f64 {
        if self.immovable[index] {
            return 0.0;
        }
        let (rows, at) = (self.rows, 3 * index);
        let w = |row: usize, column: usize| self.delassus[(at + row) * rows + at + column];
        let stiff = w(0, 0);
        let old = [self.lambda[at], self.lambda[at + 1], self.lambda[at + 2]];
        let compliance = COMPLIANCE * stiff;
        let missing = self.velocity[at] - self.target[index] + compliance * old[0];
        let normal = (old[0] - missing / (stiff + compliance)).max(0.0);
        if normal == 0.0 && old == [0.0; 3] {
            return 0.0;
        }
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
                change = change.max((step * self.delassus[(at + part) * rows + at + part]).abs());
                self.push(at + part, step);
            }
        }
        change
    }

    /// Solves the equations of the present modes for all contact points that press. Points that would pull are opened
    /// first. `false` where there are too many points or their matrix is singular.
    fn newton_step(&mut self) -> bool {
        for opened in 0..=OPENINGS {
            self.find_modes();
            let size = self.newton.unknowns.len();
            if size == 0 || size > MOST_UNKNOWNS {
                return false;
            }
            self.assemble_newton();
            let Self { lambda, newton: Newton { unknowns, system, step, opening, .. }, .. } = self;
            if !eliminate(&mut system[..size * size], &mut step[..size]) {
                return false;
            }
            opening.clear();
            for (row, step) in unknowns.iter().zip(&*step) {
                if row % 3 == 0 && lambda[*row] + step < 0.0 {
                    opening.push(*row);
                }
            }
            if opened == OPENINGS || opening.is_empty() {
                break;
            }
            for place in 0..self.newton.opening.len() {
                let at = self.newton.opening[place];
                for row in at..at + 3 {
                    self.push(row, -self.lambda[row]);
                }
            }
        }
        self.apply_step();
        true
    }

    /// Takes the Newton step, onto the cones, within which the equations of the modes may not stay.
    fn apply_step(&mut self) {
        let Newton { unknowns, modes, step, .. } = &mut self.newton;
        let mut next = 0;
        for mode in modes.iter() {
            let at = unknowns[next];
            let width = if matches!(mode, Mode::Smooth) { 1 } else { 3 };
            let mut new = [self.lambda[at], 0.0, 0.0];
            for part in 0..width {
                new[part] = self.lambda[at + part] + step[next + part];
            }
            let bound = self.friction[at / 3] * new[0];
            let size = (new[1] * new[1] + new[2] * new[2]).sqrt();
            if new[0] <= 0.0 {
                new = [0.0; 3];
            } else if size > 0.0 && (size > bound || matches!(mode, Mode::Slip(..))) {
                new = [new[0], new[1] * bound / size, new[2] * bound / size];
            }
            for part in 0..width {
                step[next + part] = new[part] - self.lambda[at + part];
            }
            next += width;
        }
        for unknown in 0..next {
            self.push(self.newton.unknowns[unknown], self.newton.step[unknown]);
        }
    }

    /// The modes of the contact points that press, and their unknowns.
    fn find_modes(&mut self) {
        let Self { rows, velocity, friction, lambda, newton, .. } = self;
        newton.unknowns.clear();
        newton.modes.clear();
        for index in 0..*rows / 3 {
            let at = 3 * index;
            let normal = lambda[at];
            if normal <= 0.0 {
                continue;
            }
            newton.unknowns.push(at);
            if friction[index] == 0.0 {
                newton.modes.push(Mode::Smooth);
                continue;
            }
            newton.unknowns.extend([at + 1, at + 2]);
            let bound = friction[index] * normal * (1.0 - 1e-9);
            let slip = [velocity[at + 1], velocity[at + 2]];
            let speed = (slip[0] * slip[0] + slip[1] * slip[1]).sqrt();
            let edge = lambda[at + 1] * lambda[at + 1] + lambda[at + 2] * lambda[at + 2] >= bound * bound;
            newton.modes.push(if edge && speed > STANDING {
                Mode::Slip(slip.map(|part| part / speed), speed)
            } else {
                Mode::Stick
            });
        }
    }

    /// The linear system of the modes. A slipping point obeys `q lambda_t + w_t = 0` with `q = |w_t| / (mu lambda_n)`.
    fn assemble_newton(&mut self) {
        let Self { rows, delassus, velocity, target, friction, lambda, newton, .. } = self;
        let Newton { unknowns, modes, system, step, .. } = newton;
        let (rows, size) = (*rows, unknowns.len());
        let mut next = 0;
        for mode in modes.iter() {
            let at = unknowns[next];
            let index = at / 3;
            let w = |row: usize, column: usize| delassus[(at + row) * rows + at + column];
            let compliance = COMPLIANCE * w(0, 0);
            for (entry, unknown) in system[next * size..][..size].iter_mut().zip(unknowns.iter()) {
                *entry = delassus[at * rows + unknown];
            }
            system[next * size + next] += compliance;
            step[next] = target[index] - velocity[at] - compliance * lambda[at];
            let soft = COMPLIANCE * w(1, 1).max(w(2, 2));
            match mode {
                Mode::Smooth => {
                    next += 1;
                    continue;
                }
                Mode::Stick => {
                    for part in 1..3 {
                        let row = &mut system[(next + part) * size..][..size];
                        for (entry, unknown) in row.iter_mut().zip(unknowns.iter()) {
                            *entry = delassus[(at + part) * rows + unknown];
                        }
                        row[next + part] += soft;
                        step[next + part] = -velocity[at + part];
                    }
                }
                Mode::Slip(along, speed) => {
                    let q = speed / (friction[index] * lambda[at]);
                    for part in 1..3 {
                        let row = &mut system[(next + part) * size..][..size];
                        let d = along[part - 1];
                        let share = |other: usize| f64::from(u8::from(part == other)) - d * along[other - 1];
                        let (one, two) = (share(1), share(2));
                        for (entry, unknown) in row.iter_mut().zip(unknowns.iter()) {
                            *entry = one * delassus[(at + 1) * rows + unknown]
                                + two * delassus[(at + 2) * rows + unknown];
                        }
                        row[next] += d * speed / lambda[at];
                        row[next + part] += q + soft;
                        step[next + part] = -velocity[at + part] - q * lambda[at + part];
                    }
                }
            }
            next += 3;
        }
    }
}

/// Solves a dense system by elimination with partial pivoting, in place. `false` where it is singular.
fn eliminate(system: &mut [f64], right: &mut [f64]) -> bool {
    let n = right.len();
    for k in 0..n {
        let (mut pivot, mut largest) = (k, system[k * n + k].abs());
        for row in k + 1..n {
            if system[row * n + k].abs() > largest {
                (pivot, largest) = (row, system[row * n + k].abs());
            }
        }
        if largest.is_nan() || largest <= f64::MIN_POSITIVE {
            return false;
        }
        if pivot != k {
            let (upper, lower) = system.split_at_mut(pivot * n);
            upper[k * n + k..][..n - k].swap_with_slice(&mut lower[k..n]);
            right.swap(k, pivot);
        }
        let (upper, lower) = system.split_at_mut((k + 1) * n);
        let own = &upper[k * n..][..n];
        let inverse = 1.0 / own[k];
        let value = right[k];
        for (row, right) in lower.chunks_exact_mut(n).zip(&mut right[k + 1..]) {
            if row[k] == 0.0 {
                continue;
            }
            let factor = row[k] * inverse;
            *right -= factor * value;
            for (entry, own) in row[k + 1..].iter_mut().zip(&own[k + 1..]) {
                *entry -= factor * own;
            }
        }
    }
    for k in (0..n).rev() {
        let row = &system[k * n..][..n];
        let value = right[k] - dot(&row[k + 1..], &right[k + 1..]);
        right[k] = value / row[k];
    }
    right.iter().all(|entry| entry.is_finite())
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
