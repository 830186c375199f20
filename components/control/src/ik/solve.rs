//! Solution of a tick: the first level, the levels below, and contradictory constraints.

use motorium_qp::{Conflict, Constraint, QpSolver, Side, SolveError};

use super::{DifferentialIk, IkConflict, IkError};
use crate::limits::are_alike;

/// Maximum number of solutions in which only constraints named by a conflict are relaxed. After that, all
/// are.
const NAMED: u32 = 8;
/// Fraction of the maximum velocity change that a row beyond its limit may use per tick to return. The rest
/// is left for other rows.
const HASTE: f64 = 0.5;
/// Number of times this change is halved before returns are dropped.
const EASED: u32 = 2;

impl<S: QpSolver> DifferentialIk<S> {
    /// Solves the assembled problem and returns the joint velocity, which satisfies its bounds exactly.
    ///
    /// A row beyond its limit returns at a speed permitted by the acceleration limit. If constraints are
    /// contradictory, they are relaxed in this order:
    ///
    /// 1. Among the returning rows in the conflict, the row that is least beyond its limit
    ///    [stays](crate::limits::LimitRows::push_barrier) in place.
    /// 2. Joints brake beyond the [acceleration limit](Self::add_acceleration_limit), conflicting joints
    ///    first. Joints accelerate beyond the limit only if a contact or an exact task requires more
    ///    acceleration.
    /// 3. If [relaxation](super::IkSettings::relaxation) is enabled, contacts and exact tasks are violated.
    ///
    /// [`conflict`](Self::conflict) then returns the contradictory constraints and the violation.
    ///
    /// # Errors
    /// [`IkError`] if no solution was found; [`velocity`](Self::velocity) is then zero.
    pub fn solve(&mut self) -> Result<&[f64], IkError> {
        (self.conflict, self.exceeds_acceleration) = (None, false);
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

    /// Computes the velocity of the first level alone.
    fn solve_first(&mut self) -> Result<(), IkError> {
        self.velocity.fill(0.0);
        self.solver.update(&self.problem)?;
        let found = self.solver.solve().map(|found| self.velocity.copy_from_slice(found.x.as_slice()));
        self.iterations += self.solver.iterations();
        found?;
        self.clamp();
        Ok(())
    }

    /// Enforces the bounds exactly: an interior-point solution may violate one by its tolerance.
    fn clamp(&mut self) {
        let limits = self.problem.lower.iter().zip(&self.problem.upper);
        for (v, (lower, upper)) in self.velocity.iter_mut().zip(limits) {
            *v = v.clamp(*lower, *upper);
        }
    }

    /// Lets the row of a conflict that is least beyond its limit stay there, with equal rows. If no row has
    /// to return, lets the named joints brake immediately. Returns `false` if the conflict has neither.
    fn give_up_named(&mut self, conflict: &Conflict) -> bool {
        let mut least: Option<(f64, usize)> = None;
        for constraint in conflict.constraints() {
            let Constraint::Row(row, _) = constraint else { continue };
            let desired = self.problem.row_lower[row].max(-self.problem.row_upper[row]);
            // among equally fast rows, the nearest pairs return; they come first
            let less =
                least.is_none_or(|(other, before)| desired < other || desired == other && row > before);
            if self.returns(row) && less {
                least = Some((desired, row));
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

    /// Lets every row beyond its limit stay there. Returns `false` if no row has to return.
    fn give_up_return(&mut self) -> bool {
        let mut stays = false;
        for row in 0..self.next_row {
            stays |= self.give_up_return_of(row);
        }
        stays
    }

    /// Lets one row beyond its limit stay there. Returns `false` if it does not have to return.
    fn give_up_return_of(&mut self, row: usize) -> bool {
        let returns = self.returns(row);
        if returns {
            let (lower, upper) = (&mut self.problem.row_lower[row], &mut self.problem.row_upper[row]);
            (*lower, *upper) = (lower.min(0.0), upper.max(0.0));
        }
        returns
    }

    /// Returns `true` if a row has to return. Soft limits may be violated, so their rows never do.
    fn returns(&self, row: usize) -> bool {
        !self.is_soft[row] && (self.problem.row_lower[row] > 0.0 || self.problem.row_upper[row] < 0.0)
    }

    /// With an acceleration limit, limits the acceleration of returning rows to [`HASTE`] of the maximum.
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

    /// Halves the velocity changes of returning rows. Returns `false` if the conflict has no returning row,
    /// or no joint that could accelerate more.
    fn ease_returns(&mut self, conflict: &Conflict) -> bool {
        let names = |predicate: &dyn Fn(Constraint) -> bool| conflict.constraints().any(predicate);
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

    /// Present velocity along a row, and the smallest and largest values allowed by the joint bounds.
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

    /// Lets all joints brake as fast as required. Returns `false` if they already may.
    fn brake(&mut self) -> bool {
        (0..self.motions).fold(false, |brakes, variable| {
            let sides = [Side::Lower, Side::Upper].map(|side| self.brake_at(variable, side));
            brakes || sides.contains(&true)
        })
    }

    /// Lets one joint brake as fast as required: a bound that excludes rest moves to zero, which all limits
    /// except the acceleration limit admit.
    fn brake_at(&mut self, variable: usize, side: Side) -> bool {
        let excludes_rest = match side {
            Side::Lower => self.problem.lower[variable] > 0.0,
            Side::Upper => self.problem.upper[variable] < 0.0,
        };
        let is_prescribed = self.wide_bounds[0][variable] == self.wide_bounds[1][variable];
        if !self.is_narrowed || !excludes_rest || is_prescribed {
            return false;
        }
        match side {
            Side::Lower => self.problem.lower[variable] = 0.0,
            Side::Upper => self.problem.upper[variable] = 0.0,
        }
        self.exceeds_acceleration = true;
        true
    }

    /// Lets joints change their velocities as fast as exact rows require. Returns `false` without exact rows
    /// or an acceleration limit.
    fn give_up_acceleration(&mut self) -> bool {
        if self.next_equality == 0 || !std::mem::replace(&mut self.is_narrowed, false) {
            return false;
        }
        self.problem.lower.copy_from(&self.wide_bounds[0]);
        self.problem.upper.copy_from(&self.wide_bounds[1]);
        self.exceeds_acceleration = true;
        true
    }

    /// Relaxes exact rows if the settings permit it. Limits admit zero velocity, so there is always a
    /// solution.
    fn relax(&mut self, conflict: Conflict) -> Result<(), IkError> {
        let Self { relaxed, problem, velocity, iterations, .. } = self;
        let found = self.conflict.insert(IkConflict::new(&conflict, self.motions));
        let relaxed = relaxed.as_mut().ok_or(SolveError::Infeasible { conflict })?;
        relaxed.update(problem, |_| ())?;
        let solved = relaxed.solve();
        *iterations += relaxed.iterations();
        solved?;
        found.slack = relaxed.missed(problem, 0..problem.equality_value.len());
        velocity.copy_from_slice(relaxed.solution().x.as_slice());
        self.clamp();
        Ok(())
    }

    /// Adds the solution of the lower levels to the first level's velocity. Higher levels keep their solution
    /// if a lower one has none.
    fn solve_below(&mut self) -> Result<(), IkError> {
        let Self { below, problem, velocity, iterations, .. } = self;
        let Some(below) = below else { return Ok(()) };
        self.undecided += below.solve(None, |solver, level, freedom| {
            let solved = solver.solve(level, freedom, problem, velocity);
            *iterations += solver.iterations;
            solved
        })?;
        self.clamp();
        Ok(())
    }
}
