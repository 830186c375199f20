//! The solution of a quadratic program.

use nalgebra::DVector;

use super::{Constraint, Side, Structure};

/// Tolerances satisfied by a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accuracy {
    /// The solution satisfies the tolerances of the settings.
    #[default]
    Full,
    /// Because of rounding, the solution satisfies only looser tolerances.
    Reduced,
}

/// The optimum of a problem, with its multipliers.
///
/// Multipliers are signed so that `P x + q + A'y + G'z + w = 0`. `z` and `w` are positive at an active upper
/// side, negative at an active lower side, and zero in between.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The optimum.
    pub x: DVector<f64>,
    /// Multipliers `y`, one per equality.
    pub equality_dual: DVector<f64>,
    /// Multipliers `z`, one per row of `G`.
    pub row_dual: DVector<f64>,
    /// Multipliers `w`, one per variable.
    pub bound_dual: DVector<f64>,
    /// Number of iterations of the solve.
    pub iterations: u32,
    /// Tolerances satisfied by the solution.
    pub accuracy: Accuracy,
}

impl Solution {
    /// Creates a solution of this structure with all values zero.
    pub fn new(structure: &Structure) -> Self {
        Self {
            x: DVector::zeros(structure.variables()),
            equality_dual: DVector::zeros(structure.equality_count()),
            row_dual: DVector::zeros(structure.row_sides().len()),
            bound_dual: DVector::zeros(structure.variables()),
            iterations: 0,
            accuracy: Accuracy::Full,
        }
    }
    /// Calls `visit` with each inequality that has a nonzero multiplier: rows, then bounds.
    pub fn visit_active(&self, visit: &mut dyn FnMut(Constraint)) {
        let side = |dual: f64| if dual > 0.0 { Side::Upper } else { Side::Lower };
        for (row, dual) in self.row_dual.iter().enumerate().filter(|(_, dual)| **dual != 0.0) {
            visit(Constraint::Row(row, side(*dual)));
        }
        for (bound, dual) in self.bound_dual.iter().enumerate().filter(|(_, dual)| **dual != 0.0) {
            visit(Constraint::Bound(bound, side(*dual)));
        }
    }
}
