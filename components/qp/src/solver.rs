//! The trait of all quadratic-program solvers.

use super::{Problem, Solution, SolveError, Structure, UpdateError};

/// A solver for one [`Structure`], reused for every tick.
///
/// `update` sets the problem data; `solve` solves that problem. A solver may warm-start from the previous
/// solution, but must reach the same optimum without it.
pub trait QpSolver: Send {
    /// Returns the structure for which this solver was built.
    fn structure(&self) -> &Structure;

    /// Replaces the problem data by `problem`.
    ///
    /// # Errors
    /// [`UpdateError`] if the structure of the problem differs from the structure of the solver, or if its
    /// data are invalid. The problem data are then unspecified; update again before solving.
    fn update(&mut self, problem: &Problem) -> Result<(), UpdateError>;

    /// Solves the problem of the last update.
    ///
    /// # Errors
    /// [`SolveError`] if the problem has no solution, or none was found.
    fn solve(&mut self) -> Result<&Solution, SolveError>;

    /// Returns the number of iterations of the last solve, successful or not.
    fn iterations(&self) -> u32;

    /// Discards the previous solution. The next solve gives the same result as a new solver, bit for bit.
    fn reset(&mut self);
}
