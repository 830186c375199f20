//! Problems recorded in single precision, and the effects of its rounding on flat costs and dependent
//! equalities.

use nalgebra::{DMatrix, DVector};

use crate::Problem;
use crate::problem::ROUNDING;

/// Returns `true` if each number is a single-precision value, exactly or as its shortest decimal
/// representation.
pub(super) fn is_single(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| {
        let single = *number as f32;
        f64::from(single) == *number || single.to_string().parse() == Ok(*number)
    })
}

/// Returns the relative rounding error of a matrix, from its recording and from the sums of products that
/// computed it.
pub(super) fn rounding(matrix: &DMatrix<f64>) -> f64 {
    let size = matrix.nrows().max(matrix.ncols()) as f64;
    if is_single(matrix.as_slice()) { size * f64::from(f32::EPSILON) } else { ROUNDING }
}

/// Removes single-precision rounding from matrices that would otherwise be rejected or misinterpreted.
///
/// A Hessian with negative curvature within rounding becomes the nearest positive semi-definite one. Along
/// its flat directions, a cost gradient within rounding becomes zero. Equalities that are dependent within
/// rounding become exactly dependent; their values agree if they did within rounding. Double-precision
/// numbers stay unchanged.
pub(super) fn clean(problem: &mut Problem) {
    let of_hessian = rounding(&problem.hessian);
    if of_hessian > ROUNDING {
        flatten(&mut problem.hessian, &mut problem.gradient, of_hessian);
    }
    let of_equalities = rounding(&problem.equality_matrix);
    if of_equalities > ROUNDING {
        reconcile(&mut problem.equality_matrix, &mut problem.equality_value, of_equalities);
    }
}

fn flatten(hessian: &mut DMatrix<f64>, gradient: &mut DVector<f64>, share: f64) {
    let mut whole = hessian.clone();
    whole.fill_lower_triangle_with_upper_triangle();
    let largest = whole.amax();
    if whole.is_empty() || largest == 0.0 {
        return;
    }
    let mut eigen = (whole / largest).symmetric_eigen();
    let least = eigen.eigenvalues.min();
    if least >= -ROUNDING || least < -share {
        return;
    }
    let mut slopes = eigen.eigenvectors.tr_mul(gradient);
    let mut steps = slopes.clone();
    for (step, curvature) in steps.iter_mut().zip(&eigen.eigenvalues) {
        *step = if *curvature > share { *step / (largest * curvature) } else { 0.0 };
    }
    let hidden = share * (largest * steps.norm() + gradient.norm());
    for (slope, curvature) in slopes.iter_mut().zip(eigen.eigenvalues.iter_mut()) {
        if *curvature > share {
            continue;
        }
        *curvature = 0.0;
        if slope.abs() <= hidden {
            *slope = 0.0;
        }
    }
    *gradient = &eigen.eigenvectors * slopes;
    *hessian = eigen.recompose() * largest;
}

fn reconcile(matrix: &mut DMatrix<f64>, value: &mut DVector<f64>, share: f64) {
    if matrix.is_empty() {
        return;
    }
    // rows with different units get equal weight
    let lengths: Vec<f64> = matrix.row_iter().map(|row| row.norm()).collect();
    let length = |row: usize| if lengths[row] > 0.0 { lengths[row] } else { 1.0 };
    let scaled =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| matrix[(row, column)] / length(row));
    let desired = DVector::from_fn(value.len(), |row, _| value[row] / length(row));
    let mut svd = scaled.svd(true, true);
    let least = share * svd.singular_values.amax();
    let rank = svd.rank(least);
    if rank == matrix.nrows() {
        return;
    }
    let Ok(step) = svd.solve(&desired, least) else { return };
    svd.singular_values
        .iter_mut()
        .filter(|singular| **singular <= least)
        .for_each(|singular| *singular = 0.0);
    let Ok(agreed) = svd.recompose() else { return };
    let reached = &agreed * &step;
    let agree = (&reached - &desired).amax() <= share * (step.norm() + desired.amax());
    for row in 0..matrix.nrows() {
        matrix.set_row(row, &(agreed.row(row) * length(row)));
        if agree {
            value[row] = reached[row] * length(row);
        }
    }
}
