//! Scaling of a problem to numbers around one, because Clarabel's tolerances are absolute.
//!
//! `x = length D x'`: `D` comes from the diagonal of `P` (Jacobi), `length` from the most distant limit, and
//! each constraint row is scaled to unit size. Without scaling, a tolerance of 1e-8 has no fixed meaning: the
//! same control problem posed in radians per tick or in radians per second would stop at errors that differ
//! by a factor of a hundred.

use super::layout::{Layout, Scaling, signed_limit};
use crate::{Constraint, Problem};

impl Scaling {
    /// Largest scaled gradient relative to the scaled Hessian. Clarabel calls a problem unbounded if a
    /// direction violates the limits by less than a millionth of its descent, so a gradient of 1e12 passes
    /// for unbounded in a box.
    const LARGEST_GRADIENT: f64 = 1e4;
    /// Smallest diagonal entry of `P` used for scaling, relative to the largest.
    const SMALLEST_CURVATURE: f64 = 1e-8;

    pub(super) fn new(layout: &Layout) -> Self {
        Self {
            variable: vec![1.0; layout.variables()],
            constraint: vec![1.0; layout.constraint_count()],
            friction: vec![0.0; layout.friction_cones().len()],
            cost: 1.0,
            length: 1.0,
        }
    }

    /// Chooses the factors for `problem` and these friction coefficients; `None` for a disabled cone.
    pub(super) fn fit(&mut self, layout: &Layout, problem: &Problem, friction: &[Option<f64>]) {
        let curvature = (0..self.variable.len()).fold(0.0, |most: f64, i| most.max(problem.hessian[(i, i)]));
        for (i, d) in self.variable.iter_mut().enumerate() {
            let p = problem.hessian[(i, i)].max(Self::SMALLEST_CURVATURE * curvature);
            *d = if p > 0.0 { p.sqrt().recip() } else { 1.0 };
        }
        // largest limit, as a distance in `x'`
        let mut reach: f64 = 0.0;
        for (row, e) in self.constraint.iter_mut().enumerate().take(layout.linear_count()) {
            let name = layout.name(row);
            let limit = signed_limit(problem, name);
            *e = if limit >= Problem::INFINITE {
                0.0
            } else {
                let size = match name {
                    Constraint::Equality(i) => largest(&self.variable, |j| problem.equality_matrix[(i, j)]),
                    Constraint::Row(i, _) => largest(&self.variable, |j| problem.row_matrix[(i, j)]),
                    Constraint::Bound(i, _) => self.variable[i],
                    Constraint::Cone(_) => 1.0,
                };
                if size > 0.0 { size.recip() } else { 1.0 }
            };
            reach = reach.max((*e * limit).abs());
        }
        // one factor for the three rows of a cone, so that it stays a cone
        for (index, (cone, friction)) in layout.friction_cones().iter().zip(friction).enumerate() {
            let [one, other] = cone.tangents.map(|tangent| self.variable[tangent]);
            let first = layout.linear_count() + 3 * index;
            let e = friction.map_or(0.0, |mu| (mu * self.variable[cone.normal]).max(one).max(other).recip());
            self.constraint[first..first + 3].fill(e);
            self.friction[index] = friction.unwrap_or(0.0);
        }
        let pull = largest(&self.variable, |j| problem.gradient[j]);
        self.length = [reach, pull, 1.0].into_iter().find(|&size| size > 0.0).unwrap_or(1.0);
        self.cost = match pull {
            0.0 => 1.0,
            _ if curvature == 0.0 => self.length / pull,
            _ => (Self::LARGEST_GRADIENT * self.length / pull).min(1.0),
        };
    }

    pub(super) fn scale_gradient(&self, problem: &Problem, out: &mut [f64]) {
        for (slot, (q, d)) in out.iter_mut().zip(problem.gradient.iter().zip(&self.variable)) {
            *slot = self.cost * d * q / self.length;
        }
    }
}

fn largest(variable: &[f64], entry: impl Fn(usize) -> f64) -> f64 {
    variable.iter().enumerate().fold(0.0, |largest, (j, d)| largest.max((d * entry(j)).abs()))
}
