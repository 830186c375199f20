//! Certificates of infeasibility: a combination of working-set members that contradicts a constraint.

use super::constraints::name;
use super::kernels::{Arithmetic, largest};
use super::run::Run;
use super::tolerances::TOLERANCES;
use crate::{Conflict, Problem, SolveError};

impl Run<'_> {
    /// Describes the conflict between the last examined constraint and the members on which it depends.
    /// `sign` is the violated side, 0 for an equality.
    #[inline(always)]
    pub(super) fn infeasible<F: Arithmetic>(
        &mut self,
        constraint: usize,
        sign: f64,
        value: f64,
    ) -> SolveError {
        self.work.progress.is_certain = self.is_proven::<F>(sign, value);
        let working = &self.work.working;
        let mut strongest = [(0.0, constraint, sign); Conflict::CAPACITY - 1];
        let mut found = 0;
        for (member, r) in working.members.iter().zip(&working.projection) {
            let weight = r.abs();
            if weight <= TOLERANCES.no_rate {
                continue;
            }
            let mut place = found.min(strongest.len());
            while place > 0 && strongest[place - 1].0 < weight {
                place -= 1;
            }
            if place < strongest.len() {
                strongest[place..].rotate_right(1);
                strongest[place] = (weight, member.constraint, member.sign);
                found = (found + 1).min(strongest.len());
            }
        }
        let (m, p) = (self.equalities(), self.problem.row_lower.len());
        let name = |constraint, sign| name(m, p, constraint, sign);
        let others = strongest[..found].iter().map(|(_, constraint, sign)| name(*constraint, *sign));
        SolveError::Infeasible {
            conflict: Conflict::new(std::iter::once(name(constraint, sign)).chain(others)),
        }
    }

    /// Returns `true` if the problem data prove the contradiction, independently of the condition of the
    /// Hessian.
    ///
    /// The normal is `a = N r + e`, where the shares `r` belong to members whose signs press against the
    /// constraint. Every `x` that satisfies the members then has `a x` beyond `r b + e x`. That exceeds the
    /// value by the gap between the two, reduced by at most `|e x|`. By Farkas' lemma the constraints
    /// contradict each other for all `x` within their bounds. Unbounded variables count only up to `far`
    /// times the known magnitude of the solution.
    #[inline(always)]
    fn is_proven<F: Arithmetic>(&mut self, sign: f64, value: f64) -> bool {
        let problem = self.problem;
        let reach = TOLERANCES.far * self.work.progress.first_size.max(1.0);
        let working = &mut self.work.working;
        let (mut implied, mut size) = (0.0, value.abs());
        for (member, r) in working.members.iter().zip(&mut working.projection) {
            // the share of a member with the opposite sign is rounding only
            if member.sign != 0.0 && (sign == 0.0 || sign * *r * member.sign > 0.0) {
                *r = 0.0;
            }
            implied += *r * member.value;
            size += (*r * member.value).abs();
        }
        let gap = if sign == 0.0 { (implied - value).abs() } else { sign * (implied - value) };
        let mut unexplained = 0.0;
        for (variable, (lower, upper)) in problem.lower.iter().zip(&problem.upper).enumerate() {
            let farthest = lower.abs().max(upper.abs());
            let farthest = if farthest < Problem::INFINITE { farthest } else { reach };
            unexplained += working.left_of_normal::<F>(variable).abs() * farthest;
        }
        gap > TOLERANCES.conflict * (1.0 + size) && gap > unexplained
    }

    /// Returns `true` if the last examined constraint is so nearly a combination of members that all of them
    /// can hold simultaneously only far beyond the first minimum. Members that contradict each other up to
    /// rounding would drive `x` and the multipliers there. Neither would have a significant digit left, and
    /// constraints would join and leave forever. The constraint therefore counts as a combination of members:
    /// one of them leaves, or the problem is infeasible. If the condition of the Hessian is poor, a second
    /// attempt decides about infeasibility.
    #[inline(always)]
    pub(super) fn is_out_of_reach<F: Arithmetic>(&mut self, excess: f64) -> bool {
        let work = &mut *self.work;
        let is_weak = work.working.left_share < TOLERANCES.nearly && work.shift == 0.0;
        if !is_weak || work.hessian.weakest() > TOLERANCES.poor {
            return false;
        }
        work.residual.copy_from_slice(&work.working.left);
        work.hessian.solve_transposed::<F>(&mut work.residual);
        excess * largest(&work.residual)
            > TOLERANCES.out_of_reach * work.progress.first_size * work.working.left_squared
    }
}
