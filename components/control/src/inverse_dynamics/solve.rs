//! Solution of a tick: the first level, its relaxation, and the levels below.

use super::control::{Below, InverseDynamics};
use super::names::Conflicting;
use super::outcome::{InverseDynamicsError, InverseDynamicsSolution, Slack};
use crate::levels::LevelError;
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
        let Some(Below { first, levels, solvers, freedom }) = &mut self.below else { return Ok(()) };
        match &self.reduced {
            Some(reduced) => freedom.open_to(reduced.map()),
            None => freedom.open(),
        }
        let mut above = &*first;
        for (level, solver) in levels.iter_mut().zip(solvers) {
            freedom.close(above);
            solver.set_max_iterations(self.settings.max_iterations.saturating_sub(self.solution.iterations));
            let solved = solver.solve(level, freedom, &self.problem, &self.contacts, self.x.as_mut_slice());
            self.solution.iterations += solver.iterations();
            match solved {
                Ok(()) => {}
                Err(LevelError::Pose(error)) => return Err(InverseDynamicsError::Pose(error)),
                // the levels above keep their solution; at its limit the solver continues in the next tick
                Err(LevelError::Solve(error)) => {
                    if !matches!(error, SolveError::MaxIterations { .. }) {
                        solver.reset();
                    }
                    self.solution.undecided += 1;
                }
            }
            above = &level.rows;
        }
        Ok(())
    }
}

/// Number of inequalities with a force on the solution.
fn active(solution: &Solution) -> usize {
    solution.row_dual.iter().chain(solution.bound_dual.iter()).filter(|dual| **dual != 0.0).count()
}
