//! The solution of a tick: the first level, those below it, and ticks whose constraints contradict each other.

use super::{Below, DifferentialIk, IkConflict, IkError};
use crate::solver::{Conflict, Constraint, QpSolver, Side, Solution, SolveError};

/// Solutions of a tick in which only those give way that a contradiction names, before all do.
const NAMED: u32 = 6;
/// Cosine of the angle between rows that are nearly the same.
const ALIKE: f64 = 0.9;

impl<S: QpSolver> DifferentialIk<S> {
    /// Solves the posed problem and returns the joint velocity, exactly within its bounds.
    ///
    /// Where constraints contradict each other, first what is beyond a limit [stays](crate::limits::LimitRows::push_barrier) instead of
    /// coming back. Then joints brake faster than the limit of [accelerations](Self::add_acceleration_limit) has it, those first that
    /// have a part in the contradiction; none speeds up faster, unless a contact or a task that holds exactly asks for it. At last, with a
    /// [relaxation](super::IkSettings::relaxation), contacts and tasks that hold exactly give way;
    /// [`conflict`](Self::conflict) names what contradicts, and says by how much.
    ///
    /// # Errors
    /// [`IkError`]; [`velocity`](Self::velocity) is zero then.
    pub fn solve(&mut self) -> Result<&[f64], IkError> {
        (self.conflict, self.is_hurried, self.iterations) = (None, false, 0);
        let mut decided = self.solve_first();
        let mut named = NAMED;
        while let Err(IkError::Solve(SolveError::Infeasible { conflict })) = &decided {
            let gives_way = match named.checked_sub(1) {
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
            self.iterations = 0;
            return Err(error);
        }
        Ok(&self.velocity[..self.motions])
    }

    /// Decides the velocity by the first level alone.
    fn solve_first(&mut self) -> Result<(), IkError> {
        self.velocity.fill(0.0);
        self.solver.update(&self.problem)?;
        let Solution { x, iterations, .. } = self.solver.solve()?;
        self.velocity.copy_from_slice(x.as_slice());
        self.iterations = *iterations;
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

    /// Lets what a contradiction names stay beyond its limit, with the rows that are alike; if nothing of it has to come back, lets the joints that it names brake at
    /// once. False if it names neither.
    fn give_up_named(&mut self, conflict: &Conflict) -> bool {
        let mut stays = false;
        for constraint in conflict.constraints() {
            let Constraint::Row(row, _) = constraint else { continue };
            if !self.give_up_return_of(row) {
                continue;
            }
            stays = true;
            for other in 0..self.next_row {
                if self.is_alike(row, other) {
                    self.give_up_return_of(other);
                }
            }
        }
        if stays {
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

    /// The same for one row. A soft limit gives way by itself.
    fn give_up_return_of(&mut self, row: usize) -> bool {
        let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
        if self.is_soft[row] || *lower <= 0.0 && *upper >= 0.0 {
            return false;
        }
        (*lower, *upper) = (lower.min(0.0), upper.max(0.0));
        true
    }

    /// True if two rows move by nearly the same motions, as those of one pair of solids do.
    fn is_alike(&self, row: usize, other: usize) -> bool {
        let (row, other) = (self.problem.row_matrix.row(row), self.problem.row_matrix.row(other));
        row.dot(&other) >= ALIKE * row.norm() * other.norm()
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
            Some(relaxed) => relaxed.solve(&self.problem, &mut self.velocity).map(|way| {
                (found.slack, self.iterations) = (way.slack, way.iterations);
            }),
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
