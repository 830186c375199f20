//! Newton steps over all contact points simultaneously.

use super::answer::COMPLIANCE;
use super::cone::{ConeSolver, dot};
use super::newton_room::{MOST_UNKNOWNS, Mode, Newton};

/// Largest number of times that a Newton step opens points that would pull.
const OPENINGS: usize = 4;

/// A contact point on the edge of its cone that is slower than this \[m/s\] counts as sticking.
const STANDING: f64 = 1e-9;

impl ConeSolver {
    /// Solves the equations of the current modes for all contact points under pressure. Points that would
    /// pull are opened first. Returns `false` if there are too many points or their matrix is singular.
    pub(super) fn newton_step(&mut self) -> bool {
        for opened in 0..=OPENINGS {
            self.find_modes();
            let size = self.newton.unknowns.len();
            if size == 0 || size > MOST_UNKNOWNS {
                return false;
            }
            self.assemble_newton();
            let Self { lambda, couples, newton, .. } = self;
            let Newton { unknowns, modes, system, step, opening, .. } = newton;
            let (system, right) = (&mut system[..size * size], &mut step[..size]);
            let slips = modes.iter().any(|mode| matches!(mode, Mode::Slip(..)));
            if !if slips { eliminate(system, right) } else { eliminate_symmetric(system, right) } {
                return false;
            }
            opening.clear();
            for (row, step) in unknowns.iter().zip(&*step) {
                if row % 3 == 0 && lambda[*row] + step < 0.0 && couples[row / 3].is_none() {
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

    /// Applies the Newton step, projected onto the cones, because the equations of the modes may lead out of
    /// them.
    fn apply_step(&mut self) {
        let Newton { unknowns, modes, step, .. } = &mut self.newton;
        let mut next = 0;
        for mode in modes.iter() {
            let at = unknowns[next];
            let width = if matches!(mode, Mode::Smooth) { 1 } else { 3 };
            if matches!(mode, Mode::Held) {
                next += width;
                continue;
            }
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

    /// Determines the modes of the contact points under pressure, and their unknowns.
    fn find_modes(&mut self) {
        let Self { rows, velocity, friction, couples, immovable, lambda, newton, .. } = self;
        newton.unknowns.clear();
        newton.modes.clear();
        for (index, friction) in friction.iter().take(*rows / 3).enumerate() {
            let at = 3 * index;
            if let Some(couple) = couples[index] {
                if couple.holds && !immovable[index] {
                    newton.unknowns.extend([at, at + 1, at + 2]);
                    newton.modes.push(Mode::Held);
                }
                continue;
            }
            let normal = lambda[at];
            if normal <= 0.0 {
                continue;
            }
            newton.unknowns.push(at);
            if *friction == 0.0 {
                newton.modes.push(Mode::Smooth);
                continue;
            }
            newton.unknowns.extend([at + 1, at + 2]);
            let bound = friction * normal * (1.0 - 1e-9);
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

    /// Assembles the linear system of the modes. A slipping point obeys `q lambda_t + w_t = 0` with
    /// `q = |w_t| / (mu lambda_n)`.
    fn assemble_newton(&mut self) {
        let Self { rows, delassus, velocity, target, friction, soft, lambda, newton, .. } = self;
        let Newton { unknowns, modes, system, step, .. } = newton;
        let (rows, size) = (*rows, unknowns.len());
        let mut next = 0;
        for mode in modes.iter() {
            let at = unknowns[next];
            let index = at / 3;
            let w = |row: usize, column: usize| delassus[(at + row) * rows + at + column];
            let held = matches!(mode, Mode::Held);
            // The joints may block a connection along any of its axes.
            let largest = if held { w(0, 0).max(w(1, 1)).max(w(2, 2)) } else { w(0, 0) };
            let compliance = COMPLIANCE * largest + soft[index];
            choose(&delassus[at * rows..][..rows], unknowns, &mut system[next * size..][..size]);
            system[next * size + next] += compliance;
            step[next] = target[index] - velocity[at] - compliance * lambda[at];
            let tangents = if held { compliance } else { COMPLIANCE * w(1, 1).max(w(2, 2)) };
            match mode {
                Mode::Smooth => {
                    next += 1;
                    continue;
                }
                Mode::Stick | Mode::Held => {
                    for part in 1..3 {
                        let row = &mut system[(next + part) * size..][..size];
                        choose(&delassus[(at + part) * rows..][..rows], unknowns, row);
                        row[next + part] += tangents;
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
                        row[next + part] += q + tangents;
                        step[next + part] = -velocity[at + part] - q * lambda[at + part];
                    }
                }
            }
            next += 3;
        }
    }
}

/// Copies the entries of a row of W that belong to the unknowns.
fn choose(row: &[f64], unknowns: &[usize], into: &mut [f64]) {
    if unknowns.len() == row.len() {
        into.copy_from_slice(row);
        return;
    }
    for (entry, unknown) in into.iter_mut().zip(unknowns) {
        *entry = row[*unknown];
    }
}

/// Solves a dense system in place by elimination with partial pivoting. Returns `false` if it is singular.
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
        let own = &own[..width(own)];
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
    substitute(system, right)
}

/// Solves a dense system with a symmetric positive definite matrix in place, such as W if nothing slips. Only
/// the entries from the diagonal on are read. Returns `false` if the matrix is not positive definite.
fn eliminate_symmetric(system: &mut [f64], right: &mut [f64]) -> bool {
    let n = right.len();
    for k in 0..n {
        let (upper, lower) = system.split_at_mut((k + 1) * n);
        let own = &upper[k * n..][..n];
        if own[k].is_nan() || own[k] <= f64::MIN_POSITIVE {
            return false;
        }
        let own = &own[..width(own)];
        let (inverse, value) = (1.0 / own[k], right[k]);
        for (i, row) in (k + 1..own.len()).zip(lower.chunks_exact_mut(n)) {
            if own[i] == 0.0 {
                continue;
            }
            let factor = own[i] * inverse;
            right[i] -= factor * value;
            for (entry, own) in row[i..].iter_mut().zip(&own[i..]) {
                *entry -= factor * own;
            }
        }
    }
    substitute(system, right)
}

/// Returns the length of a row up to its last nonzero entry; points of objects that do not touch are not
/// coupled.
fn width(row: &[f64]) -> usize {
    row.iter().rposition(|entry| *entry != 0.0).map_or(0, |last| last + 1)
}

/// Completes an elimination: `system` is upper triangular. Returns `false` if the solution is not finite.
fn substitute(system: &[f64], right: &mut [f64]) -> bool {
    let n = right.len();
    for k in (0..n).rev() {
        let row = &system[k * n..][..n];
        let value = right[k] - dot(&row[k + 1..], &right[k + 1..]);
        right[k] = value / row[k];
    }
    right.iter().all(|entry| entry.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_eliminations_solve_a_positive_definite_system() {
        // A = B B' + 1, with a solution chosen in advance.
        let n = 7;
        let b = |row: usize, column: usize| ((3 * row + 5 * column) as f64).sin();
        let entry = |row: usize, column: usize| {
            (0..n).map(|k| b(row, k) * b(column, k)).sum::<f64>() + f64::from(u8::from(row == column))
        };
        let system: Vec<f64> = (0..n * n).map(|place| entry(place / n, place % n)).collect();
        let solution: Vec<f64> = (0..n).map(|k| (1.7 * k as f64).cos()).collect();
        let right: Vec<f64> = system.chunks_exact(n).map(|row| dot(row, &solution)).collect();
        for solve in [eliminate, eliminate_symmetric] {
            let (mut system, mut found) = (system.clone(), right.clone());
            assert!(solve(&mut system, &mut found));
            for (found, expected) in found.iter().zip(&solution) {
                assert!((found - expected).abs() < 1e-12, "{found}, {expected}");
            }
        }
        let (mut indefinite, mut right) = ([1.0, 2.0, 2.0, 1.0], [1.0, 1.0]);
        assert!(!eliminate_symmetric(&mut indefinite, &mut right));
    }
}
