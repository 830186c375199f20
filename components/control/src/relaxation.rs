//! Relaxation of contradictory constraints.

use core::ops::Range;

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, Constraint, Problem, QpSolver, Sides, Solution, SolveError,
    Structure, UpdateError,
};

/// Constraints of a problem that may be violated.
#[derive(Clone, Debug)]
pub(crate) struct Relaxable {
    /// Index of the first equality that becomes a cost; all later ones do as well.
    pub(crate) first_equality: usize,
    /// Variables whose bounds are relaxed.
    pub(crate) bounds: Range<usize>,
    /// Rows that are relaxed.
    pub(crate) rows: Range<usize>,
}

/// A problem with relaxed constraints: equalities become costs, and bounds and rows get a slack `s` with the
/// same cost.
///
/// ```text
/// minimise   (cost) + 1/2 weight^2 |A_r x - b_r|^2 + 1/2 weight^2 |s|^2
/// subject to A_e x = b_e,   lower <= x + s <= upper,   lower <= G x + s <= upper
/// ```
///
/// The rows of `A_r` are weighted by their tasks, which determines the distribution of the violation.
#[derive(Debug)]
pub(crate) struct Relaxation {
    relaxable: Relaxable,
    weight: f64,
    /// Variables without slacks.
    variables: usize,
    problem: Problem,
    solver: ActiveSetSolver,
    /// `true` if the previous tick was relaxed as well: its working set is the best initial guess.
    was_relaxed: bool,
}

impl Relaxation {
    /// Creates a relaxation for problems of this structure, with this cost of a violation.
    pub(crate) fn new(structure: &Structure, relaxable: Relaxable, weight: f64) -> Self {
        let (variables, rows) = (structure.variables(), structure.row_sides().len());
        let Relaxable { first_equality, bounds, rows: yielding } = relaxable.clone();
        let slacks = bounds.len() + yielding.len();
        let mut wide = Structure::new(variables + slacks).equalities(first_equality);
        for sides in structure.row_sides() {
            wide = wide.rows(1, *sides);
        }
        wide = wide.rows(bounds.len(), Sides::Both);
        for (variable, sides) in structure.bound_sides().iter().enumerate() {
            if !bounds.contains(&variable) {
                wide = wide.bound(variable, *sides);
            }
        }
        let mut problem = Problem::new(&wide);
        for (index, bound) in bounds.enumerate() {
            problem.row_matrix[(rows + index, bound)] = 1.0;
        }
        // slacks of the bounds, whose rows come last, then slacks of the rows
        let first = relaxable.bounds.len();
        for slack in 0..slacks {
            let row = slack.checked_sub(first).map_or(rows + slack, |index| yielding.start + index);
            problem.row_matrix[(row, variables + slack)] = 1.0;
            problem.hessian[(variables + slack, variables + slack)] = weight * weight;
        }
        let solver = ActiveSetSolver::new(wide, ActiveSetSettings::default());
        Self { relaxable, weight, variables, problem, solver, was_relaxed: false }
    }

    /// Limits the iterations of the next solve.
    pub(crate) fn set_max_iterations(&mut self, most: u32) {
        self.solver.set_max_iterations(Some(most));
    }

    /// Starts a tick. After an unrelaxed tick, the initial working set is the one at which the contradiction
    /// was found.
    pub(crate) fn begin(&mut self, working_set: impl Iterator<Item = (Constraint, f64)>) {
        if std::mem::replace(&mut self.was_relaxed, true) {
            return;
        }
        let (bounds, first) =
            (&self.relaxable.bounds, self.problem.row_lower.len() - self.relaxable.bounds.len());
        let yielding = |constraint| match constraint {
            Constraint::Bound(variable, side) if bounds.contains(&variable) => {
                Constraint::Row(first + variable - bounds.start, side)
            }
            constraint => constraint,
        };
        self.solver
            .warm_start(working_set.map(|(constraint, multiplier)| (yielding(constraint), multiplier)));
    }

    /// Records a tick without relaxation.
    pub(crate) fn leave(&mut self) {
        self.was_relaxed = false;
    }

    /// Writes the relaxed form of `posed`, and applies `adjust` to it.
    ///
    /// # Errors
    /// If the numbers of the problem are invalid.
    pub(crate) fn update(
        &mut self,
        posed: &Problem,
        adjust: impl FnOnce(&mut Problem),
    ) -> Result<(), UpdateError> {
        let Self { relaxable: Relaxable { first_equality, bounds, .. }, weight, problem, .. } = self;
        let (variables, rows) = (self.variables, posed.row_lower.len());
        problem.hessian.view_mut((0, 0), (variables, variables)).copy_from(&posed.hessian);
        problem.gradient.rows_mut(0, variables).copy_from(&posed.gradient);
        let exact = posed.equality_matrix.rows(0, *first_equality);
        problem.equality_matrix.columns_mut(0, variables).copy_from(&exact);
        problem.equality_value.copy_from(&posed.equality_value.rows(0, *first_equality));
        problem.row_matrix.view_mut((0, 0), (rows, variables)).copy_from(&posed.row_matrix);
        problem.row_lower.rows_mut(0, rows).copy_from(&posed.row_lower);
        problem.row_upper.rows_mut(0, rows).copy_from(&posed.row_upper);
        for variable in 0..variables {
            let (mut lower, mut upper) = (&mut problem.lower[variable], &mut problem.upper[variable]);
            if bounds.contains(&variable) {
                let row = rows + variable - bounds.start;
                (lower, upper) = (&mut problem.row_lower[row], &mut problem.row_upper[row]);
            }
            (*lower, *upper) = (posed.lower[variable], posed.upper[variable]);
        }
        let squared = *weight * *weight;
        for row in *first_equality..posed.equality_value.len() {
            let (matrix, value) = (&posed.equality_matrix, posed.equality_value[row]);
            for j in 0..variables {
                let weighted = squared * matrix[(row, j)];
                if weighted == 0.0 {
                    continue;
                }
                problem.gradient[j] -= weighted * value;
                for i in 0..=j {
                    problem.hessian[(i, j)] += weighted * matrix[(row, i)];
                }
            }
        }
        adjust(problem);
        self.solver.update(problem)
    }

    /// Solves the relaxed problem.
    ///
    /// # Errors
    /// If the solver reached its limit.
    pub(crate) fn solve(&mut self) -> Result<(), SolveError> {
        self.solver.solve().map(drop)
    }

    /// The last solution, with the slacks of the bounds and of the rows after the variables.
    pub(crate) fn solution(&self) -> &Solution {
        self.solver.solution()
    }

    /// Iterations of the last solve.
    pub(crate) fn iterations(&self) -> u32 {
        self.solver.iterations()
    }

    /// Returns the largest `|A x - b|` of these equalities of `posed` at the last solution.
    pub(crate) fn missed(&self, posed: &Problem, equalities: Range<usize>) -> f64 {
        let x = &self.solver.solution().x;
        equalities.fold(0.0, |most: f64, row| {
            let entries = (0..self.variables).map(|j| posed.equality_matrix[(row, j)] * x[j]);
            most.max((entries.sum::<f64>() - posed.equality_value[row]).abs())
        })
    }

    /// The largest slacks of bounds and of rows at the last solution.
    pub(crate) fn slacks(&self) -> [f64; 2] {
        let (bounds, rows) =
            self.solver.solution().x.as_slice()[self.variables..].split_at(self.relaxable.bounds.len());
        [bounds, rows].map(|slacks| slacks.iter().fold(0.0, |most: f64, slack| most.max(slack.abs())))
    }

    /// Clears the state of previous ticks.
    pub(crate) fn reset(&mut self) {
        self.solver.reset();
        self.was_relaxed = false;
    }
}
