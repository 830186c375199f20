//! A level below the first with friction cones.

use motorium_qp::{ClarabelSettings, ClarabelSolver, Problem, QpSolver, Sides, Structure};
use nalgebra::DVector;

use super::contact::ContactPlace;
use super::order::Order;
use super::solver::{friction_cones, set_friction};
use crate::levels::{Freedom, Level, LevelError, LevelSolver, SolveLevel};

/// The solver of a level below the first: active-set within friction pyramids, Clarabel within cones.
#[derive(Debug)]
pub(super) enum LowerSolver {
    Pyramids(Box<LevelSolver>),
    Cones(Box<ConeLevel>),
}

impl LowerSolver {
    pub(super) fn new(order: &Order, structure: &Structure, cones: bool) -> Self {
        match cones {
            false => Self::Pyramids(Box::new(LevelSolver::new(order.variables(), order.rows()))),
            true => Self::Cones(Box::new(ConeLevel::new(order, structure))),
        }
    }

    /// Adds to `x` the best motion for the level, within the limits and the friction of the contacts.
    pub(super) fn solve(
        &mut self,
        level: &mut Level,
        freedom: &Freedom,
        limits: &Problem,
        contacts: &[ContactPlace],
        x: &mut [f64],
    ) -> Result<(), LevelError> {
        match self {
            Self::Pyramids(solver) => solver.solve(level, freedom, limits, x),
            Self::Cones(solver) => solver.solve(level, freedom, limits, contacts, x),
        }
    }

    /// Iterations of the last solve.
    pub(super) fn iterations(&self) -> u32 {
        match self {
            Self::Pyramids(solver) => solver.iterations,
            Self::Cones(solver) => solver.iterations,
        }
    }

    /// Limits the iterations of the next solve. Clarabel has a separate limit.
    pub(super) fn set_max_iterations(&mut self, most: u32) {
        if let Self::Pyramids(solver) = self {
            solver.set_max_iterations(most);
        }
    }
}

impl SolveLevel for LowerSolver {
    fn reset(&mut self) {
        match self {
            Self::Pyramids(solver) => solver.reset(),
            Self::Cones(solver) => solver.solver.reset(),
        }
    }
}

/// A level in the unknowns `(x, z)`, since a cone constrains unknowns rather than combinations of them:
///
/// ```text
/// minimise   1/4 x'Px + 1/2 q'x + 1/4 z'(Z'PZ)z + 1/2 (Z'(P x* + q))'z
/// subject to x - Z z = x*                         x*: decided above; Z: basis of the motions that are open
///            limits, rows and friction cones of x
/// ```
///
/// The cost is split equally between both, so that both are scaled.
#[derive(Debug)]
pub(super) struct ConeLevel {
    problem: Problem,
    solver: ClarabelSolver,
    /// `P` times a column of `Z`, and `P x + q`.
    product: DVector<f64>,
    slope: DVector<f64>,
    /// Iterations of the last solve.
    iterations: u32,
}

impl ConeLevel {
    fn new(order: &Order, structure: &Structure) -> Self {
        let n = order.variables();
        let mut wide = Structure::new(2 * n).equalities(n);
        for sides in structure.row_sides() {
            wide = wide.rows(1, *sides);
        }
        for (variable, sides) in structure.bound_sides().iter().enumerate() {
            if *sides != Sides::Neither {
                wide = wide.bound(variable, *sides);
            }
        }
        let mut problem = Problem::new(&wide);
        problem.equality_matrix.view_mut((0, 0), (n, n)).fill_with_identity();
        let cones = friction_cones(order, order.velocities);
        let solver = ClarabelSolver::with_cones(wide, cones, ClarabelSettings::default());
        Self { problem, solver, product: DVector::zeros(n), slope: DVector::zeros(n), iterations: 0 }
    }

    fn solve(
        &mut self,
        level: &mut Level,
        freedom: &Freedom,
        limits: &Problem,
        contacts: &[ContactPlace],
        x: &mut [f64],
    ) -> Result<(), LevelError> {
        let (n, open) = (x.len(), freedom.count());
        self.iterations = 0;
        if open == 0 {
            return Ok(());
        }
        let problem = &mut self.problem;
        let cost = &mut level.cost;
        cost.hessian.fill_lower_triangle_with_upper_triangle();
        problem.hessian.fill(0.0);
        problem.hessian.view_mut((0, 0), (n, n)).zip_apply(&cost.hessian, |to, from| *to = 0.5 * from);
        problem.gradient.fill(0.0);
        problem.gradient.rows_mut(0, n).axpy(0.5, &cost.gradient, 0.0);
        self.slope.copy_from(&cost.gradient);
        for (column, x) in cost.hessian.column_iter().zip(&*x) {
            self.slope.axpy(*x, &column, 1.0);
        }
        let basis = freedom.basis();
        for (j, direction) in basis.column_iter().enumerate() {
            problem
                .equality_matrix
                .view_mut((0, n + j), (n, 1))
                .zip_apply(&direction, |to, from| *to = -from);
            if j >= open {
                // inactive columns have no direction; give them a unit cost
                problem.hessian[(n + j, n + j)] = 1.0;
                continue;
            }
            self.product.gemv(0.5, &cost.hessian, &direction, 0.0);
            for (i, other) in basis.columns(0, j + 1).column_iter().enumerate() {
                problem.hessian[(n + i, n + j)] = other.dot(&self.product);
            }
            problem.gradient[n + j] = 0.5 * direction.dot(&self.slope);
        }
        problem.equality_value.as_mut_slice().copy_from_slice(x);
        problem.row_matrix.columns_mut(0, n).copy_from(&limits.row_matrix);
        problem.row_lower.copy_from(&limits.row_lower);
        problem.row_upper.copy_from(&limits.row_upper);
        problem.lower.rows_mut(0, n).copy_from(&limits.lower);
        problem.upper.rows_mut(0, n).copy_from(&limits.upper);
        set_friction(&mut self.solver, contacts);
        self.solver.update(problem)?;
        let solved = self.solver.solve().map(|_| ());
        self.iterations = self.solver.iterations();
        solved?;
        let found = self.solver.solution();
        x.copy_from_slice(&found.x.as_slice()[..n]);
        Ok(())
    }
}
