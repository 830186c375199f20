//! Optimality conditions of a quadratic program, checked from its numbers alone.

use nalgebra::DVector;

use super::{Problem, Solution};

/// Residuals of the Karush-Kuhn-Tucker conditions at a claimed solution, in the problem's own units.
///
/// For a convex problem a point with all residuals zero is optimal (Boyd and Vandenberghe, *Convex
/// Optimization*, 5.5.3). The check allocates; it is meant for tests and diagnosis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KktResidual {
    /// `max |P x + q + A'y + G'z + w|`.
    pub stationarity: f64,
    /// Largest violation of an equality, a row or a bound.
    pub feasibility: f64,
    /// Largest product of a multiplier and the distance to the side at which it acts, or the multiplier alone
    /// if that side is infinite.
    pub complementarity: f64,
}

impl KktResidual {
    /// Computes the residuals of `solution` for `problem`, which must have the same structure.
    pub fn from_solution(problem: &Problem, solution: &Solution) -> Self {
        let n = problem.gradient.len();
        let x = &solution.x;
        let mut stationarity = problem.gradient.clone() + &solution.bound_dual;
        for row in 0..n {
            for column in 0..n {
                let p = problem.hessian[(row.min(column), row.max(column))];
                stationarity[row] += p * x[column];
            }
        }
        stationarity += problem.equality_matrix.transpose() * &solution.equality_dual;
        stationarity += problem.row_matrix.transpose() * &solution.row_dual;

        let equality = &problem.equality_matrix * x - &problem.equality_value;
        let mut residual = Self {
            stationarity: largest(&stationarity),
            feasibility: largest(&equality),
            complementarity: 0.0,
        };
        let rows = &problem.row_matrix * x;
        residual.two_sided(&rows, &problem.row_lower, &problem.row_upper, &solution.row_dual);
        residual.two_sided(x, &problem.lower, &problem.upper, &solution.bound_dual);
        residual
    }

    /// Returns the largest of the three residuals.
    pub fn worst(&self) -> f64 {
        worse(worse(self.stationarity, self.feasibility), self.complementarity)
    }

    fn two_sided(
        &mut self,
        value: &DVector<f64>,
        lower: &DVector<f64>,
        upper: &DVector<f64>,
        dual: &DVector<f64>,
    ) {
        for i in 0..value.len() {
            let below = lower[i] - value[i];
            let above = value[i] - upper[i];
            self.feasibility = worse(worse(self.feasibility, below), above);
            let (pressure, slack) = if dual[i] >= 0.0 { (dual[i], -above) } else { (-dual[i], -below) };
            let product = if slack < Problem::INFINITE / 2.0 { pressure * slack.abs() } else { pressure };
            self.complementarity = worse(self.complementarity, product);
        }
    }
}

/// Returns the larger number, or NaN if either is NaN, which `f64::max` would hide.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

fn largest(numbers: &DVector<f64>) -> f64 {
    numbers.iter().fold(0.0, |largest, number| worse(largest, number.abs()))
}
