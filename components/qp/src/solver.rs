//! The trait of all solvers.

use super::{Problem, Solution, SolveError, Structure, UpdateError};

/// A solver for one [`Structure`], reused for every tick.
///
/// `update` sets the problem data, `solve` solves the last problem set. A solver may warm-start from the
/// previous solution, but must reach the same optimum without it.
pub trait QpSolver: Send {
    /// The structure this solver was built for.
    fn structure(&self) -> &Structure;

    /// Replaces the problem data by `problem`.
    ///
    /// # Errors
    /// [`UpdateError`] if the problem has another structure or invalid data. The problem data are then
    /// unspecified: update again before solving.
    fn update(&mut self, problem: &Problem) -> Result<(), UpdateError>;

    /// Solves the problem of the last update.
    ///
    /// # Errors
    /// [`SolveError`] if there is no solution, or none was found.
    fn solve(&mut self) -> Result<&Solution, SolveError>;

    /// Iterations of the last solve, successful or not.
    fn iterations(&self) -> u32;

    /// Discards the previous solution: the next solve is bitwise equal to a new solver's.
    fn reset(&mut self);
}
