//! Errors of quadratic programs: invalid data and problems without a solution.

use std::fmt;

use super::Side;

/// One scalar constraint of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Constraint {
    /// Row of `A`.
    Equality(usize),
    /// Row of `G`, on one side.
    Row(usize, Side),
    /// Bound of a variable, on one side.
    Bound(usize, Side),
    /// Friction cone, see [`ClarabelSolver::with_cones`](super::ClarabelSolver::with_cones).
    Cone(usize),
}

impl fmt::Display for Constraint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Equality(i) => write!(f, "equality {i}"),
            Self::Row(i, side) => write!(f, "{side} side of row {i}"),
            Self::Bound(i, side) => write!(f, "{side} bound of variable {i}"),
            Self::Cone(i) => write!(f, "cone {i}"),
        }
    }
}

/// The constraints with the largest multipliers in a certificate of infeasibility, strongest first.
///
/// A certificate is a combination of constraints that no `x` satisfies. The constraints with the largest
/// multipliers (after scaling each row to unit size) are the candidates for relaxation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conflict {
    constraints: [Option<Constraint>; Self::CAPACITY],
}

impl Conflict {
    /// Maximum number of constraints in a conflict.
    pub const CAPACITY: usize = 4;

    /// Collects up to [`Conflict::CAPACITY`] constraints, strongest first.
    pub fn new(strongest_first: impl IntoIterator<Item = Constraint>) -> Self {
        let mut conflict = Self::default();
        for (slot, constraint) in conflict.constraints.iter_mut().zip(strongest_first) {
            *slot = Some(constraint);
        }
        conflict
    }

    /// Returns the constraints of the conflict, strongest first.
    pub fn constraints(&self) -> impl Iterator<Item = Constraint> + '_ {
        self.constraints.iter().flatten().copied()
    }
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (count, constraint) in self.constraints().enumerate() {
            if count > 0 {
                f.write_str(", ")?;
            }
            constraint.fmt(f)?;
        }
        Ok(())
    }
}

/// Error returned when problem data are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum UpdateError {
    /// A matrix or vector does not have the size required by the structure.
    #[error(
        "{what} is {}x{}, expected {}x{} as in the solver's structure; build a solver for the new structure",
        found.0, found.1, expected.0, expected.1
    )]
    Shape {
        /// Letter of the matrix or vector in the problem statement.
        what: &'static str,
        /// Rows and columns found.
        found: (usize, usize),
        /// Rows and columns expected.
        expected: (usize, usize),
    },
    /// A NaN or infinity where a finite number is required.
    #[error(
        "{what}[{row}, {column}] is {value}, expected a finite number; check the robot state and the targets"
    )]
    NotFinite {
        /// Letter of the matrix or vector in the problem statement.
        what: &'static str,
        /// Row of the invalid entry.
        row: usize,
        /// Column of the invalid entry.
        column: usize,
        /// Value of the entry.
        value: f64,
    },
    /// The lower bound exceeds the upper bound, or a bound is unsatisfiable.
    #[error("{constraint}: {lower} <= ... <= {upper} has no solution; expected lower <= upper")]
    Crossed {
        /// The constraint, with its lower side.
        constraint: Constraint,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A bound is finite on a side that the structure does not declare.
    #[error(
        "{constraint} is {value}, but the structure declares no bound on this side; declare the side in the structure"
    )]
    Undeclared {
        /// The constraint.
        constraint: Constraint,
        /// Value of the bound.
        value: f64,
    },
}

/// Error returned when a solve finds no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// No `x` satisfies the constraints.
    #[error(
        "infeasible: no x satisfies all constraints; conflict between {conflict}; relax one of these constraints"
    )]
    Infeasible {
        /// The constraints that contradict each other.
        conflict: Conflict,
    },
    /// The cost decreases forever along a direction that no constraint blocks.
    #[error(
        "unbounded: the cost decreases forever along variable {variable}; regularise or bound this variable"
    )]
    Unbounded {
        /// The variable that changes most along that direction.
        variable: usize,
    },
    /// The cost is not convex: it has negative curvature along a direction.
    #[error(
        "not convex: P is not positive semi-definite, as its leading {} x {} block shows; check the signs of its numbers",
        .variable + 1, .variable + 1
    )]
    NotConvex {
        /// Variable at whose row the factorisation stopped.
        variable: usize,
    },
    /// The iteration limit was reached.
    #[error("no solution within {iterations} iterations; scale the problem or raise the limit")]
    MaxIterations {
        /// Number of iterations performed.
        iterations: u32,
    },
    /// The arithmetic broke down or stopped making progress.
    #[error("numerical breakdown after {iterations} iterations; regularise or scale the problem")]
    Numerical {
        /// Number of iterations performed.
        iterations: u32,
    },
    /// The solver has no valid problem data.
    #[error("no problem to solve: the last update failed or is missing; call update first")]
    NotUpdated,
}
