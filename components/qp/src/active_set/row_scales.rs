//! Scaling of equalities and rows, so that tolerances have the same meaning for rows of any unit.

use nalgebra::{DMatrix, DVector};

use super::working_set::WorkingSet;
use crate::{Problem, Solution};

/// Range of a row's largest entry that needs no scaling. A problem whose rows are all within it is solved in
/// its original values, bit for bit.
const BAND: std::ops::RangeInclusive<f64> = 0.03125..=32.0;

/// A factor for each equality and each row, in this order. It is 1 within [`BAND`]; otherwise it is the power
/// of two that brings the largest entry between 1 and 2. Powers of two add no rounding.
#[derive(Debug)]
pub(super) struct RowScales {
    scales: Vec<f64>,
    /// Scales of the previous update, to which the multipliers of the working set refer.
    previous: Vec<f64>,
    any: bool,
}

impl RowScales {
    pub(super) fn new(equalities: usize, rows: usize) -> Self {
        let ones = vec![1.0; equalities + rows];
        Self { scales: ones.clone(), previous: ones, any: false }
    }

    /// Returns the scale of a constraint by its number; 1 for a bound.
    pub(super) fn get(&self, constraint: usize) -> f64 {
        self.scales.get(constraint).copied().unwrap_or(1.0)
    }

    /// Chooses the scales for `problem` and applies them to it and to the multipliers of the previous working
    /// set.
    pub(super) fn apply(&mut self, problem: &mut Problem, working: &mut WorkingSet) {
        let had_any = self.any;
        std::mem::swap(&mut self.scales, &mut self.previous);
        let (equalities, rows) = self.scales.split_at_mut(problem.equality_value.len());
        let of_equalities = choose(&problem.equality_matrix, equalities);
        self.any = choose(&problem.row_matrix, rows) || of_equalities;
        if self.any {
            scale(&mut problem.equality_matrix, equalities);
            scale(&mut problem.row_matrix, rows);
            problem.equality_value.iter_mut().zip(&*equalities).for_each(|(value, scale)| *value *= scale);
            limits(&mut problem.row_lower, rows);
            limits(&mut problem.row_upper, rows);
        }
        if self.any || had_any {
            for member in &mut working.members {
                if let Some(scale) = self.scales.get(member.constraint) {
                    member.multiplier *= self.previous[member.constraint] / scale;
                }
            }
        }
    }

    /// Converts the multipliers of the scaled problem into multipliers of the original problem.
    pub(super) fn restore(&self, solution: &mut Solution) {
        if self.any {
            let duals = solution.equality_dual.iter_mut().chain(solution.row_dual.iter_mut());
            duals.zip(&self.scales).for_each(|(dual, scale)| *dual *= scale);
        }
    }
}

/// Writes the scale of each row of a matrix. Returns `true` if one differs from 1.
fn choose(matrix: &DMatrix<f64>, scales: &mut [f64]) -> bool {
    scales.fill(0.0);
    if scales.is_empty() {
        return false;
    }
    for column in matrix.as_slice().chunks_exact(scales.len()) {
        for (largest, entry) in scales.iter_mut().zip(column) {
            *largest = largest.max(entry.abs());
        }
    }
    let mut any = false;
    for scale in scales {
        let largest = *scale;
        *scale = 1.0;
        if largest > 0.0 && !BAND.contains(&largest) {
            let exponent = ((largest.to_bits() >> 52) & 0x7ff).clamp(1, 2045);
            *scale = f64::from_bits((2046 - exponent) << 52);
            any = true;
        }
    }
    any
}

fn scale(matrix: &mut DMatrix<f64>, scales: &[f64]) {
    if !scales.is_empty() {
        for column in matrix.as_mut_slice().chunks_exact_mut(scales.len()) {
            column.iter_mut().zip(scales).for_each(|(entry, scale)| *entry *= scale);
        }
    }
}

/// Scales the sides of rows; an absent side stays absent.
fn limits(sides: &mut DVector<f64>, scales: &[f64]) {
    for (side, scale) in sides.iter_mut().zip(scales) {
        if side.abs() < Problem::INFINITE {
            *side *= scale;
        }
    }
}
