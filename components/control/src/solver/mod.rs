//! Quadratic programs with a fixed structure, solved once a tick.
//!
//! ```text
//! minimise    1/2 x'Px + q'x
//! subject to  A x = b,   lg <= G x <= ug,   lb <= x <= ub
//! ```
//!
//! The data are dense and small (tens of variables). [`Structure`] fixes the dimensions and the sides on
//! which rows and variables may be bounded; a [`Problem`] holds the numbers and is overwritten in place each
//! tick; a [`QpSolver`] is built from the structure, so that everything is allocated before the first tick.
//! [`ActiveSetSolver`] is the solver of a control loop, [`ClarabelSolver`] the reference. [`KktResidual`]
//! checks a claimed solution independently of its solver.

pub mod active_set;
pub mod clarabel;
mod error;
mod kkt;
mod problem;
pub mod recorded;
mod solution;
mod structure;

pub use self::active_set::{ActiveSetSettings, ActiveSetSolver};
pub use self::clarabel::{ClarabelSettings, ClarabelSolver, FrictionCone};
pub use error::{Conflict, Constraint, SolveError, UpdateError};
pub use kkt::KktResidual;
pub use problem::Problem;
pub use solution::{Accuracy, Solution};
pub use structure::{Side, Sides, Structure};

/// Relative negative curvature of a Hessian that counts as zero, from rounding.
const ROUNDING: f64 = 1e-9;

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
