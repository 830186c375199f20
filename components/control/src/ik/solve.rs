//! The solution of a tick: the first level, those below it, and ticks whose constraints contradict each other.

use super::{Below, DifferentialIk, IkConflict, IkError};
use crate::limits::are_alike;
use crate::solver::{Conflict, Constraint, QpSolver, Side, SolveError};

/// Solutions of a tick in which only those give way that a contradiction names, before all do.
const NAMED: u32 = 8;
/// Share of the largest change of a velocity by which a way back is to become faster in a tick: what is left is for the other rows.
const HASTE: f64 = 0.5;
/// Number of times that ways back halve this change, before they are given up.
const EASED: u32 = 2;

impl<S: QpSolver> DifferentialIk<S> {
    /// Solves the posed problem and returns the joint velocity, exactly within its bounds.
    ///
    /// A row beyond its limit comes back at a speed that the limit of accelerations allows. Where constraints contradict each other,
    /// first of what comes back and has a part in the contradiction that [stays](crate::limits::LimitRows::push_barrier) which is least
    /// beyond its limit. Then joints brake faster than the limit of [accelerations](Self::add_acceleration_limit) has it, those first that
    /// have a part in the contradiction; none speeds up faster, unless a contact or a task that holds exactly asks for it. At last, with a
    /// [relaxation](super::IkSettings::relaxation), contacts and tasks that hold exactly give way;
    /// [`conflict`](Self::conflict) names what contradicts, and says by how much.
    ///
    /// # Errors
    /// [`IkError`]; [`velocity`](Self::velocity) is zero then.
    pub fn solve(&mut self) -> Result<&[f64], IkError> {
        (self.conflict, self.is_hurried) = (None, false);
        (self.iterations, self.undecided) = (0, 0);
        self.slow_returns();
        let mut decided = self.solve_first();
        let (mut named, mut eased) = (NAMED, if self.is_narrowed { EASED } else { 0 });
        while let Err(IkError::Solve(SolveError::Infeasible { conflict })) = &decided {
            let gives_way = match named.checked_sub(1) {
                Some(_) if eased > 0 && self.ease_returns(conflict) => {
                    eased -= 1;
                    true
                }
                Some(left) if self.give_up_named(conflict) => {
                    named = left;
                    true
                }
                _ => self.give_up_return() || self.brake() || self.give_up_acceleration(),
            };
            if !gives_way {
                break;
            }
            decided = self.solve_first();
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
        let found = self.solver.solve().map(|found| self.velocity.copy_from_slice(found.x.as_slice()));
        self.iterations += self.solver.iterations();
        found?;
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

    /// Lets that row of a contradiction stay beyond its limit which is least beyond it, with the rows that are alike; if nothing of it has to
    /// come back, lets the joints that it names brake at once. False if it names neither.
    fn give_up_named(&mut self, conflict: &Conflict) -> bool {
        let mut least: Option<(f64, usize)> = None;
        for constraint in conflict.constraints() {
            let Constraint::Row(row, _) = constraint else { continue };
            let wanted = self.problem.row_lower[row].max(-self.problem.row_upper[row]);
            // of those that are equally fast the nearest pairs, which come first, come back
            let less = least.is_none_or(|(other, before)| wanted < other || wanted == other && row > before);
            if self.returns(row) && less {
                least = Some((wanted, row));
            }
        }
        if let Some((_, row)) = least {
            self.give_up_return_of(row);
            for other in 0..self.next_row {
                if are_alike(&self.problem.row_matrix, row, other) {
                    self.give_up_return_of(other);
                }
            }
            return true;
        }
        let mut brakes = false;
        for constraint in conflict.constraints() {
            if let Constraint::Bound(variable, side) = constraint {
                brakes |= self.brake_at(variable, side);
            }
        }
        brakes
    }

    /// Lets what is beyond a limit stay there. False if nothing has to come back.
    fn give_up_return(&mut self) -> bool {
        let mut stays = false;
        for row in 0..self.next_row {
            stays |= self.give_up_return_of(row);
        }
        stays
    }

    /// The same for one row.
    fn give_up_return_of(&mut self, row: usize) -> bool {
        let returns = self.returns(row);
        if returns {
            let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
            (*lower, *upper) = (lower.min(0.0), upper.max(0.0));
        }
        returns
    }

    /// True if a row has to come back. A soft limit gives way by itself.
    fn returns(&self, row: usize) -> bool {
        !self.is_soft[row] && (self.problem.row_lower[row] > 0.0 || self.problem.row_upper[row] < 0.0)
    }

    /// With a limit of accelerations, lets what comes back become faster by [`HASTE`] of what it could at most.
    fn slow_returns(&mut self) {
        if !self.is_narrowed {
            return;
        }
        for row in 0..self.next_row {
            if !self.returns(row) {
                continue;
            }
            let (now, least, largest) = self.range(row);
            let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
            if *lower > 0.0 {
                *lower = (now + HASTE * (largest - now)).clamp(0.0, *lower);
            }
            if *upper < 0.0 {
                *upper = (now + HASTE * (least - now)).clamp(*upper, 0.0);
            }
        }
    }

    /// Halves the changes of velocity that ways back ask for. False if the contradiction names no way back, or no joint that could hurry.
    fn ease_returns(&mut self, conflict: &Conflict) -> bool {
        let names = |wanted: &dyn Fn(Constraint) -> bool| conflict.constraints().any(wanted);
        let returns = names(&|constraint| matches!(constraint, Constraint::Row(row, _) if self.returns(row)));
        if !returns || !names(&|constraint| matches!(constraint, Constraint::Bound(..))) {
            return false;
        }
        for row in 0..self.next_row {
            if !self.returns(row) {
                continue;
            }
            let (now, ..) = self.range(row);
            let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
            if *lower > 0.0 {
                *lower -= 0.5 * (*lower - now.max(0.0)).max(0.0);
            }
            if *upper < 0.0 {
                *upper += 0.5 * (now.min(0.0) - *upper).max(0.0);
            }
        }
        true
    }

    /// The present velocity along a row, and the least and the largest that the bounds of the joints admit.
    fn range(&self, row: usize) -> (f64, f64, f64) {
        let (mut now, mut least, mut largest) = (0.0, 0.0, 0.0);
        for variable in 0..self.motions {
            let entry = self.problem.row_matrix[(row, variable)];
            if entry == 0.0 {
                continue;
            }
            let (lower, upper) = (self.problem.lower[variable], self.problem.upper[variable]);
            now += entry * self.before[variable].max(lower).min(upper);
            least += (entry * lower).min(entry * upper);
            largest += (entry * lower).max(entry * upper);
        }
        (now, least, largest)
    }

    /// Lets all joints brake as fast as they have to. False if they may already.
    fn brake(&mut self) -> bool {
        (0..self.motions).fold(false, |brakes, variable| {
            let sides = [Side::Lower, Side::Upper].map(|side| self.brake_at(variable, side));
            brakes || sides.contains(&true)
        })
    }

    /// The same for one joint: a bound that excludes standing still goes to zero, which all limits but that of accelerations admit.
    fn brake_at(&mut self, variable: usize, side: Side) -> bool {
        let excludes_rest = match side {
            Side::Lower => self.problem.lower[variable] > 0.0,
            Side::Upper => self.problem.upper[variable] < 0.0,
        };
        if !self.is_narrowed || !excludes_rest {
            return false;
        }
        match side {
            Side::Lower => self.problem.lower[variable] = 0.0,
            Side::Upper => self.problem.upper[variable] = 0.0,
        }
        self.is_hurried = true;
        true
    }

    /// Lets joints change their velocities as fast as what holds exactly asks for. False without that, or without a limit of accelerations.
    fn give_up_acceleration(&mut self) -> bool {
        if self.next_equality == 0 || !std::mem::replace(&mut self.is_narrowed, false) {
            return false;
        }
        self.problem.lower.copy_from(&self.unhurried[0]);
        self.problem.upper.copy_from(&self.unhurried[1]);
        self.is_hurried = true;
        true
    }

    /// Lets go what holds exactly, if the settings say so.
    fn relax(&mut self, conflict: Conflict) -> Result<(), IkError> {
        let mut found = IkConflict::new(conflict, self.motions);
        let relaxed = match &mut self.relaxed {
            None => Err(IkError::Solve(SolveError::Infeasible { conflict })),
            Some(relaxed) => {
                let way = relaxed.solve(&self.problem, &mut self.velocity);
                self.iterations += relaxed.iterations();
                way.map(|slack| found.slack = slack)
            }
        };
        self.conflict = Some(found);
        relaxed?;
        self.clamp();
        Ok(())
    }

    /// Moves the velocity of the first level by what the levels below decide. What is decided above a level without a solution is a
    /// solution, too.
    fn solve_below(&mut self) -> Result<(), IkError> {
        let Some(Below { first, levels, solvers, freedom }) = &mut self.below else { return Ok(()) };
        freedom.open();
        let mut above = &*first;
        for (level, solver) in levels.iter_mut().zip(solvers) {
            freedom.close(above);
            let solved = solver.solve(level, freedom, &self.problem, &mut self.velocity);
            self.iterations += solver.iterations;
            match solved {
                Err(IkError::Solve(error)) => {
                    // at its limit the solver goes on in the next tick
                    if !matches!(error, SolveError::MaxIterations { .. }) {
                        solver.reset();
                    }
                    self.undecided += 1;
                }
                solved => solved?,
            }
            above = &level.rows;
        }
        self.clamp();
        Ok(())
    }
}
