//! Solution of a tick: the first level, its relaxation, and the levels below.

use super::control::InverseDynamics;
use super::outcome::{InverseDynamicsError, InverseDynamicsSolution, Slack};
use super::reduced::Reduced;
use crate::conflict::Conflicting;
use crate::solver::{Solution, SolveError};

impl InverseDynamics {
    /// Solves the assembled problem.
    ///
    /// # Errors
    /// [`InverseDynamicsError`]: the constraints are infeasible and may not be relaxed, or the solver reached
    /// its limit.
    pub fn solve(&mut self) -> Result<&InverseDynamicsSolution, InverseDynamicsError> {
        (self.solution.slack, self.solution.undecided, self.solution.iterations) = (None, 0, 0);
        match self.solve_returning()? {
            Ok(()) => {
                if let Some(relaxed) = &mut self.relaxed {
                    relaxed.leave();
                }
                let mut active = 0;
                self.visit_active(&mut |_| active += 1);
                self.solution.active = active;
                self.solve_below()?;
                if let Some(reduced) = &mut self.reduced {
                    let left = self.settings.max_iterations.saturating_sub(self.solution.iterations);
                    let distributed = reduced.distribute(&self.order, &self.problem, &mut self.x, left);
                    self.solution.iterations += reduced.iterations();
                    distributed.map_err(InverseDynamicsError::Solve)?;
                }
            }
            Err(error) => {
                let conflict = match &error {
                    SolveError::Infeasible { conflict } => match &self.reduced {
                        Some(reduced) => self.order.conflicting(&reduced.conflict(&self.order, conflict)),
                        None => self.order.conflicting(conflict),
                    },
                    _ => Conflicting::default(),
                };
                let Some(relaxed) = &mut self.relaxed else {
                    return Err(match error {
                        SolveError::Infeasible { .. } => InverseDynamicsError::Infeasible(conflict),
                        error => InverseDynamicsError::Solve(error),
                    });
                };
                // the constraints have other indices in a reduced problem
                let seed = self.reduced.is_none().then(|| self.solver.working_set());
                let left = self.settings.max_iterations.saturating_sub(self.solution.iterations);
                relaxed.begin(&self.order, seed.into_iter().flatten(), left);
                let solved = relaxed.solve(&self.order, &self.problem);
                self.solution.iterations += relaxed.iterations();
                let slack = Slack { conflict, ..solved? };
                let found = relaxed.solution();
                self.x.copy_from(&found.x.rows(0, self.order.variables()));
                self.solution.active = active(found);
                self.solution.slack = Some(slack);
            }
        }
        self.write();
        Ok(&self.solution)
    }

    /// Adds the solution of the lower levels to the first level's.
    fn solve_below(&mut self) -> Result<(), InverseDynamicsError> {
        let Self { below, reduced, problem, contacts, settings, solution, x, .. } = self;
        let Some(below) = below else { return Ok(()) };
        let iterations = &mut solution.iterations;
        solution.undecided += below.solve(reduced.as_ref().map(Reduced::map), |solver, level, freedom| {
            solver.set_max_iterations(settings.max_iterations.saturating_sub(*iterations));
            let solved = solver.solve(level, freedom, problem, contacts, x.as_mut_slice());
            *iterations += solver.iterations();
            solved
        })?;
        Ok(())
    }
}

/// Number of inequalities with a force on the solution.
fn active(solution: &Solution) -> usize {
    solution.row_dual.iter().chain(solution.bound_dual.iter()).filter(|dual| **dual != 0.0).count()
}
