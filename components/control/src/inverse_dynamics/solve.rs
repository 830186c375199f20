//! Solution of a tick: the first level, its relaxation, and the levels below.

use motorium_qp::{Problem, Solution, SolveError};

use super::control::InverseDynamics;
use super::order::Order;
use super::outcome::{InverseDynamicsError, InverseDynamicsSolution, Slack};
use super::reduced::Reduced;
use crate::conflict::Conflicting;

impl InverseDynamics {
    /// Solves the assembled problem.
    ///
    /// # Errors
    /// [`InverseDynamicsError`] if the constraints are infeasible and relaxation is disabled, or the solver
    /// reached its limit.
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
                let (order, posed, solution) = (&self.order, &self.problem, &mut self.solution);
                relaxed.set_max_iterations(self.settings.max_iterations.saturating_sub(solution.iterations));
                relaxed.begin(seed.into_iter().flatten());
                relaxed.update(posed, |problem| unload(order, posed, problem))?;
                let solved = relaxed.solve();
                solution.iterations += relaxed.iterations();
                solved.map_err(InverseDynamicsError::Solve)?;
                let tasks = order.equalities() - order.constrained;
                let [joint, limit] = relaxed.slacks();
                let slack = Slack {
                    contact: relaxed.missed(posed, order.base..tasks),
                    task: relaxed.missed(posed, tasks..order.equalities()),
                    joint,
                    limit,
                    conflict,
                };
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

/// Adjusts a relaxed problem so that zero torques and forces are always a solution: soles have no minimum
/// load. Friction cones become the inscribed pyramids that the active-set solver supports.
fn unload(order: &Order, posed: &Problem, relaxed: &mut Problem) {
    for wrench in order.first_limit() - order.wrenches.len()..order.first_limit() {
        relaxed.row_lower[wrench] = relaxed.row_lower[wrench].min(0.0);
    }
    for point in 0..order.points.len() {
        let normal = order.velocities + 3 * point + 2;
        if posed.upper[normal] > 0.0 {
            relaxed.row_upper.rows_mut(order.joints + 4 * point, 4).fill(0.0);
        }
    }
}

/// Number of inequalities that act on the solution.
fn active(solution: &Solution) -> usize {
    solution.row_dual.iter().chain(solution.bound_dual.iter()).filter(|dual| **dual != 0.0).count()
}
