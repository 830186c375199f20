//! The constraints of a problem by number: equalities first, then rows, then bounds.

use super::kernels::Arithmetic;
use super::run::Run;
use super::tolerances::TOLERANCES;
use crate::{Accuracy, Constraint, Problem, Side};

/// The most violated constraint.
pub(super) struct Violated {
    pub(super) constraint: usize,
    pub(super) sign: f64,
    pub(super) value: f64,
    /// Distance of `x` beyond the value.
    pub(super) excess: f64,
}

/// Returns the constraint with number `constraint` of a problem with `m` equalities and `p` rows, on the side
/// given by `sign`.
pub(super) fn name(m: usize, p: usize, constraint: usize, sign: f64) -> Constraint {
    let side = if sign > 0.0 { Side::Upper } else { Side::Lower };
    if constraint < m {
        Constraint::Equality(constraint)
    } else if constraint < m + p {
        Constraint::Row(constraint - m, side)
    } else {
        Constraint::Bound(constraint - m - p, side)
    }
}

/// Calls `visit` with the nonzero entries of the normal of a constraint.
#[inline(always)]
fn visit_normal(problem: &Problem, constraint: usize, mut visit: impl FnMut(usize, f64)) {
    let (m, p) = (problem.equality_value.len(), problem.row_lower.len());
    let (matrix, rows, row) = match constraint {
        _ if constraint < m => (&problem.equality_matrix, m, constraint),
        _ if constraint < m + p => (&problem.row_matrix, p, constraint - m),
        _ => return visit(constraint - m - p, 1.0),
    };
    for (variable, column) in matrix.as_slice().chunks_exact(rows).enumerate() {
        visit(variable, column[row]);
    }
}

impl Run<'_> {
    #[inline(always)]
    pub(super) fn equalities(&self) -> usize {
        self.problem.equality_value.len()
    }

    /// Returns the value at which a constraint is held on one of its sides.
    #[inline(always)]
    pub(super) fn value(&self, constraint: usize, sign: f64) -> f64 {
        let (m, p) = (self.equalities(), self.problem.row_lower.len());
        let problem = self.problem;
        if constraint < m {
            problem.equality_value[constraint]
        } else if constraint < m + p {
            let values = if sign > 0.0 { &problem.row_upper } else { &problem.row_lower };
            values[constraint - m]
        } else {
            let values = if sign > 0.0 { &problem.upper } else { &problem.lower };
            values[constraint - m - p]
        }
    }

    /// Returns `true` if both sides of a row or bound are equal. Its multiplier may then have either sign, as
    /// for an equality.
    #[inline(always)]
    pub(super) fn is_fixed(&self, constraint: usize) -> bool {
        self.value(constraint, -1.0) == self.value(constraint, 1.0)
    }

    /// Returns `true` if all entries of an equality are zero.
    #[inline(always)]
    pub(super) fn is_empty(&self, equality: usize) -> bool {
        self.problem.equality_matrix.row(equality).iter().all(|entry| *entry == 0.0)
    }

    /// Writes the normal of a constraint that is to be adopted as a member.
    #[inline(always)]
    pub(super) fn write_normal(&mut self, member: usize, constraint: usize) {
        let working = &mut self.work.working;
        visit_normal(self.problem, constraint, |variable, entry| working.set_normal(variable, member, entry));
    }

    /// Writes the normal of a constraint that is to be examined.
    #[inline(always)]
    pub(super) fn take_normal(&mut self, constraint: usize) {
        let normal = &mut self.work.working.normal;
        normal.fill(0.0);
        visit_normal(self.problem, constraint, |variable, entry| normal[variable] = entry);
    }

    /// Returns the row or bound that `x` violates most, or the first violated one if `by_number` is set.
    #[inline(always)]
    pub(super) fn violated<F: Arithmetic>(&mut self, by_number: bool) -> Option<Violated> {
        let problem = self.problem;
        let (m, p, n) = (self.equalities(), problem.row_lower.len(), problem.gradient.len());
        let work = &mut *self.work;
        let tolerance = self.settings.feasibility;
        let mut found: Option<Violated> = None;
        let mut worst = tolerance;
        let x = &work.x[..n];
        let is_member = &work.is_member;
        let mut consider = |constraint: usize, value: f64, lower: f64, upper: f64| {
            let (above, below) = (value - upper, lower - value);
            let (excess, sign, side) = if above > below { (above, 1.0, upper) } else { (below, -1.0, lower) };
            if excess <= worst || is_member[constraint] || by_number && found.is_some() {
                return;
            }
            // An excess within the rounding error of the sum is no violation.
            let terms = if constraint < m + p {
                let i = constraint - m;
                x.iter().enumerate().map(|(j, x)| (problem.row_matrix[(i, j)] * x).abs()).sum()
            } else {
                value.abs()
            };
            if excess > tolerance * (1.0 + side.abs()) + TOLERANCES.sum * terms {
                found = Some(Violated { constraint, sign, value: side, excess });
                worst = excess;
            }
        };
        if p > 0 {
            work.rows.fill(0.0);
            for (column, x) in problem.row_matrix.as_slice().chunks_exact(p).zip(x) {
                for (row, g) in work.rows.iter_mut().zip(column) {
                    *row = F::multiply_add(*g, *x, *row);
                }
            }
            for i in 0..p {
                consider(m + i, work.rows[i], problem.row_lower[i], problem.row_upper[i]);
            }
        }
        for (i, x) in x.iter().enumerate() {
            consider(m + p + i, *x, problem.lower[i], problem.upper[i]);
        }
        found
    }

    /// Writes the solution.
    #[inline(always)]
    pub(super) fn write(&mut self) {
        let (m, p) = (self.equalities(), self.problem.row_lower.len());
        let n = self.problem.gradient.len();
        let solution = &mut *self.solution;
        solution.x.as_mut_slice().copy_from_slice(&self.work.x[..n]);
        solution.equality_dual.fill(0.0);
        solution.row_dual.fill(0.0);
        solution.bound_dual.fill(0.0);
        for member in &self.work.working.members {
            let constraint = member.constraint;
            if constraint < m {
                solution.equality_dual[constraint] = member.multiplier;
            } else if constraint < m + p {
                solution.row_dual[constraint - m] = member.multiplier;
            } else {
                solution.bound_dual[constraint - m - p] = member.multiplier;
                solution.x[constraint - m - p] = member.value;
            }
        }
        solution.iterations = self.work.progress.iterations;
        solution.accuracy =
            if self.work.progress.within_rounding { Accuracy::Reduced } else { Accuracy::Full };
    }
}
