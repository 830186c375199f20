//! The solution of a tick: the first level, those below it, and ticks whose constraints contradict each other.

use super::{Below, DifferentialIk, IkConflict, IkError};
use crate::solver::{QpSolver, Solution, SolveError};

impl<S: QpSolver> DifferentialIk<S> {
    /// Solves the posed problem and returns the joint velocity, exactly within its bounds.
    ///
    /// Where constraints contradict each other, first what is beyond a limit [stays](crate::limits::LimitRows::push_barrier) instead of
    /// coming back, and then the limit of [accelerations](Self::add_acceleration_limit) is given up. At last, with a [relaxation](super::IkSettings::relaxation), contacts and tasks that hold exactly give way;
    /// [`conflict`](Self::conflict) names what contradicts, and says by how much.
    ///
    /// # Errors
    /// [`IkError`]; [`velocity`](Self::velocity) is zero then.
    pub fn solve(&mut self) -> Result<&[f64], IkError> {
        self.conflict = None;
        self.is_hurried = false;
        let mut decided = self.solve_first();
        for give_up in [Self::give_up_return, Self::give_up_acceleration] {
            if matches!(decided, Err(IkError::Solve(SolveError::Infeasible { .. }))) && give_up(self) {
                decided = self.solve_first();
            }
        }
        if let Err(IkError::Solve(SolveError::Infeasible { conflict })) = decided {
            decided = self.relax(conflict);
        }
        if let Err(error) = decided.and_then(|()| self.solve_below()) {
            self.velocity.fill(0.0);
            return Err(error);
        }
        Ok(&self.velocity[..self.motions])
    }

    /// Decides the velocity by the first level alone.
    fn solve_first(&mut self) -> Result<(), IkError> {
        self.velocity.fill(0.0);
        self.solver.update(&self.problem)?;
        let Solution { x, .. } = self.solver.solve()?;
        self.velocity.copy_from_slice(x.as_slice());
        self.clamp();
        Ok(())
    }

    /// Keeps the bounds exactly: an interior-point solution may touch one from outside by its tolerance.
    fn clamp(&mut self) {
        let limits = self.problem.lower.iter().zip(&self.problem.upper);
        for (v, (lower, upper)) in self.velocity.iter_mut().zip(limits) {
            *v = v.clamp(*lower, *upper);
        }
    }

    /// Lets what is beyond a limit stay there. False if nothing has to come back.
    fn give_up_return(&mut self) -> bool {
        let mut given_up = false;
        for row in 0..self.next_row {
            let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
            given_up |= *lower > 0.0 || *upper < 0.0;
            (*lower, *upper) = ((*lower).min(0.0), (*upper).max(0.0));
        }
        given_up
    }

    /// Lets joints change their velocities faster than they accelerate. False without such a limit.
    fn give_up_acceleration(&mut self) -> bool {
        if std::mem::replace(&mut self.is_narrowed, false) {
            self.problem.lower.copy_from(&self.unhurried[0]);
            self.problem.upper.copy_from(&self.unhurried[1]);
            self.is_hurried = true;
        }
        self.is_hurried
    }

    /// Lets go what holds exactly, if the settings say so.
    fn relax(&mut self, conflict: crate::solver::Conflict) -> Result<(), IkError> {
        let mut found = IkConflict::new(conflict, self.motions);
        let relaxed = match &mut self.relaxed {
            None => Err(IkError::Solve(SolveError::Infeasible { conflict })),
            Some(relaxed) => {
                relaxed.solve(&self.problem, &mut self.velocity).map(|slack| found.slack = slack)
            }
        };
        self.conflict = Some(found);
        relaxed?;
        self.clamp();
        Ok(())
    }

    /// Moves the velocity of the first level by what the levels below decide.
    fn solve_below(&mut self) -> Result<(), IkError> {
        let Some(Below { first, levels, solvers, freedom }) = &mut self.below else { return Ok(()) };
        freedom.open();
        let mut above = &*first;
        for (level, solver) in levels.iter_mut().zip(solvers) {
            freedom.close(above);
            solver.solve(level, freedom, &self.problem, &mut self.velocity)?;
            above = &level.rows;
        }
        self.clamp();
        Ok(())
    }
}
