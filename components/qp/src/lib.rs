//! Quadratic programs with a fixed structure, solved once per control tick.
//!
//! ```text
//! minimise    1/2 x'Px + q'x
//! subject to  A x = b,   lg <= G x <= ug,   lb <= x <= ub
//! ```
//!
//! The data are dense and small (tens of variables). [`Structure`] fixes the dimensions and the sides on
//! which rows and variables may be bounded. A [`Problem`] holds the numbers and is overwritten in place each
//! tick. A [`QpSolver`] is built from the structure, so that everything is allocated before the first tick.
//! [`ActiveSetSolver`] is the solver for control loops, [`ClarabelSolver`] the reference. [`KktResidual`]
//! checks a claimed solution independently of its solver. [`recorded`] reads problems from files.
//!
//! ```
//! use motorium_qp::{ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, Structure};
//!
//! // the point of the box [0, 1] x [0, 1] that is nearest to (2, 0.5)
//! let structure = Structure::new(2).bounds(Sides::Both);
//! let mut problem = Problem::new(&structure);
//! problem.hessian.fill_with_identity();
//! problem.gradient.copy_from_slice(&[-2.0, -0.5]);
//! problem.lower.fill(0.0);
//! problem.upper.fill(1.0);
//! let mut solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
//! solver.update(&problem)?;
//! assert_eq!(solver.solve()?.x.as_slice(), [1.0, 0.5]);
//! # Ok::<_, Box<dyn std::error::Error>>(())
//! ```

pub mod active_set;
pub mod clarabel;
mod error;
mod kkt;
mod problem;
pub mod recorded;
mod solution;
mod solver;
mod structure;

pub use self::active_set::{ActiveSetSettings, ActiveSetSolver};
pub use self::clarabel::{ClarabelSettings, ClarabelSolver, FrictionCone};
pub use error::{Conflict, Constraint, SolveError, UpdateError};
pub use kkt::KktResidual;
pub use problem::Problem;
pub use solution::{Accuracy, Solution};
pub use solver::QpSolver;
pub use structure::{Side, Sides, Structure};
