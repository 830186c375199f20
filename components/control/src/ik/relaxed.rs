//! A tick with contradictory constraints: contacts and exact tasks are relaxed.

use crate::ik::IkError;
use crate::solver::{ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Structure};

/// The relaxed problem: exact rows become costs.
///
/// ```text
/// minimise   (cost of the tasks) + 1/2 weight^2 |A_c v - b_c|^2
/// subject to lower <= v <= upper,   lower <= G v <= upper
/// ```
///
/// The rows of `A_c` are weighted by their tasks, which determines the distribution of the violation. Limits
/// admit `v = 0`, so there is always a solution.
#[derive(Debug)]
pub(super) struct Relaxed {
    weight: f64,
    problem: Problem,
    solver: ActiveSetSolver,
}

impl Relaxed {
    pub(super) fn new(structure: &Structure, weight: f64) -> Self {
        let structure = structure.clone().equalities(0);
        Self {
            weight,
            problem: Problem::new(&structure),
            solver: ActiveSetSolver::new(structure, ActiveSetSettings::default()),
        }
    }

    /// Solves `posed`, relaxed. Returns the largest `|A_c v - b_c|`.
    ///
    /// # Errors
    /// The numbers of the problem are of no use, or the solver reached its limit.
    pub(super) fn solve(&mut self, posed: &Problem, velocity: &mut [f64]) -> Result<f64, IkError> {
        let Self { weight, problem, solver } = self;
        problem.hessian.copy_from(&posed.hessian);
        problem.gradient.copy_from(&posed.gradient);
        problem.row_matrix.copy_from(&posed.row_matrix);
        problem.row_lower.copy_from(&posed.row_lower);
        problem.row_upper.copy_from(&posed.row_upper);
        problem.lower.copy_from(&posed.lower);
        problem.upper.copy_from(&posed.upper);
        let held = &posed.equality_matrix;
        let squared = *weight * *weight;
        for (j, column) in held.column_iter().enumerate() {
            problem.gradient[j] -= squared * column.dot(&posed.equality_value);
            for i in 0..=j {
                problem.hessian[(i, j)] += squared * held.column(i).dot(&column);
            }
        }
        solver.update(problem)?;
        let found = solver.solve()?;
        velocity.copy_from_slice(found.x.as_slice());
        let missed = held.row_iter().zip(&posed.equality_value).map(|(row, value)| {
            let moved: f64 = row.iter().zip(velocity.iter()).map(|(entry, v)| entry * v).sum();
            (moved - value).abs()
        });
        Ok(missed.fold(0.0, f64::max))
    }

    /// Iterations of the last solve.
    pub(super) fn iterations(&self) -> u32 {
        self.solver.iterations()
    }

    pub(super) fn reset(&mut self) {
        self.solver.reset();
    }
}
