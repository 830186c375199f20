//! Levels of strict priority below the first.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, SolveError, Structure, UpdateError,
};
use nalgebra::DVector;

use super::{Freedom, Rows};

/// Error of a level without a solution.
#[derive(Debug)]
pub(crate) enum LevelError {
    /// Its numbers are invalid.
    Pose(UpdateError),
    /// The solver found no solution.
    Solve(SolveError),
}

impl From<UpdateError> for LevelError {
    fn from(error: UpdateError) -> Self {
        Self::Pose(error)
    }
}

impl From<SolveError> for LevelError {
    fn from(error: SolveError) -> Self {
        Self::Solve(error)
    }
}

/// The solver of a level.
pub(crate) trait SolveLevel {
    /// Discards the previous solution.
    fn reset(&mut self);
}

/// Tasks of one level: their cost on the joint velocity, and the rows that determine motions.
#[derive(Debug)]
pub(crate) struct Level {
    /// Cost on the joint velocity, without limits.
    pub(crate) cost: Problem,
    pub(crate) rows: Rows,
    /// Regularisation: cost of each unknown. It determines no motion.
    pub(crate) damping: f64,
}

impl Level {
    /// Creates a level of tasks with `rows` rows in total and this regularisation.
    pub(crate) fn new(variables: usize, rows: usize, damping: f64) -> Self {
        Self { cost: Problem::new(&Structure::new(variables)), rows: Rows::new(variables, rows), damping }
    }

    /// Starts a tick without tasks.
    pub(crate) fn begin(&mut self) {
        self.cost.hessian.fill(0.0);
        self.cost.hessian.fill_diagonal(self.damping);
        self.cost.gradient.fill(0.0);
        self.rows.clear();
    }
}

/// Solves a level within the motions that are free for it.
///
/// With `v` the velocity determined so far and `Z` the basis of the free motions, the level computes `z` of
/// `v + Z z`:
///
/// ```text
/// minimise   1/2 z' (Z'PZ) z + (Z'(P v + q))' z
/// subject to lower - v <= Z z <= upper - v,   lg - G v <= G Z z <= ug - G v
/// ```
///
/// `z = 0` is always possible: no level can make the ones above it infeasible. The problem keeps its size
/// regardless of the free directions: unknowns without a motion have a separate cost and stay zero.
#[derive(Debug)]
pub(crate) struct LevelSolver {
    problem: Problem,
    solver: ActiveSetSolver,
    /// `P` times a column of `Z`.
    product: DVector<f64>,
    /// `P v + q`.
    slope: DVector<f64>,
    /// `G v`.
    rows: DVector<f64>,
    /// Iterations of the last solve.
    pub(crate) iterations: u32,
}

impl LevelSolver {
    /// Creates a solver for `variables` bounded unknowns and `rows` limits of their combinations.
    pub(crate) fn new(variables: usize, rows: usize) -> Self {
        let structure = Structure::new(variables).rows(variables + rows, Sides::Both);
        Self {
            problem: Problem::new(&structure),
            solver: ActiveSetSolver::new(structure, ActiveSetSettings::default()),
            product: DVector::zeros(variables),
            slope: DVector::zeros(variables),
            rows: DVector::zeros(rows),
            iterations: 0,
        }
    }

    /// Adds to `velocity` the optimal motion of the level, within the bounds and rows of `limits`.
    ///
    /// # Errors
    /// If the level has no solution; `velocity` keeps the solution of the levels above.
    pub(crate) fn solve(
        &mut self,
        level: &mut Level,
        freedom: &Freedom,
        limits: &Problem,
        velocity: &mut [f64],
    ) -> Result<(), LevelError> {
        let open = freedom.count();
        self.iterations = 0;
        if open == 0 {
            return Ok(());
        }
        let Level { cost, .. } = level;
        cost.hessian.fill_lower_triangle_with_upper_triangle();
        let basis = freedom.basis().columns(0, open);
        self.slope.copy_from(&cost.gradient);
        for (column, velocity) in cost.hessian.column_iter().zip(&*velocity) {
            self.slope.axpy(*velocity, &column, 1.0);
        }
        let problem = &mut self.problem;
        problem.hessian.fill_with_identity();
        problem.gradient.fill(0.0);
        // column by column, because a product of whole matrices would allocate
        for (j, direction) in basis.column_iter().enumerate() {
            self.product.gemv(1.0, &cost.hessian, &direction, 0.0);
            for (i, other) in basis.columns(0, j + 1).column_iter().enumerate() {
                problem.hessian[(i, j)] = other.dot(&self.product);
            }
            problem.gradient[j] = direction.dot(&self.slope);
        }
        let (variables, rows) = (velocity.len(), limits.row_matrix.nrows());
        problem.row_matrix.rows_mut(0, variables).copy_from(freedom.basis());
        for (joint, velocity) in velocity.iter().enumerate() {
            // undo the rounding of the limits
            problem.row_lower[joint] = (limits.lower[joint] - velocity).min(0.0);
            problem.row_upper[joint] = (limits.upper[joint] - velocity).max(0.0);
        }
        if rows > 0 {
            self.rows.fill(0.0);
            for (column, velocity) in limits.row_matrix.column_iter().zip(&*velocity) {
                self.rows.axpy(*velocity, &column, 1.0);
            }
            problem.row_matrix.view_mut((variables, open), (rows, variables - open)).fill(0.0);
            for (j, direction) in basis.column_iter().enumerate() {
                let mut column = problem.row_matrix.column_mut(j);
                column.rows_mut(variables, rows).gemv(1.0, &limits.row_matrix, &direction, 0.0);
            }
            for (row, value) in self.rows.iter().enumerate() {
                problem.row_lower[variables + row] = (limits.row_lower[row] - value).min(0.0);
                problem.row_upper[variables + row] = (limits.row_upper[row] - value).max(0.0);
            }
        }
        self.solver.update(problem)?;
        let solved = self.solver.solve().map(|_| ());
        self.iterations = self.solver.iterations();
        solved?;
        let solution = self.solver.solution();
        for (direction, z) in basis.column_iter().zip(&solution.x) {
            for (velocity, share) in velocity.iter_mut().zip(&direction) {
                *velocity += z * share;
            }
        }
        Ok(())
    }

    /// Limits the iterations of the next solve.
    pub(crate) fn set_max_iterations(&mut self, most: u32) {
        self.solver.set_max_iterations(Some(most));
    }
}

impl SolveLevel for LevelSolver {
    fn reset(&mut self) {
        self.solver.reset();
    }
}
