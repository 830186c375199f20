//! Cholesky factorisation in place, without allocation.

use nalgebra::DMatrix;

/// Factors the symmetric positive definite `m` (its lower triangle is read) into `L L'`, L in the lower triangle.
///
/// # Errors
///
/// The row of the pivot that is not positive, or not a number.
pub(super) fn factor(m: &mut DMatrix<f64>) -> Result<(), usize> {
    let n = m.nrows();
    for j in 0..n {
        let scale = m[(j, j)];
        let mut pivot = scale;
        for k in 0..j {
            pivot -= m[(j, k)] * m[(j, k)];
        }
        // Below this share of the diagonal, what is left is rounding noise around an exact zero.
        if pivot.is_nan() || pivot <= scale * 1e-14 {
            return Err(j);
        }
        let pivot = pivot.sqrt();
        m[(j, j)] = pivot;
        for i in j + 1..n {
            let mut entry = m[(i, j)];
            for k in 0..j {
                entry -= m[(i, k)] * m[(j, k)];
            }
            m[(i, j)] = entry / pivot;
        }
    }
    Ok(())
}

/// Solves `L L' x = b` in place.
pub(super) fn solve(l: &DMatrix<f64>, x: &mut [f64]) {
    let n = x.len();
    for i in 0..n {
        for k in 0..i {
            x[i] -= l[(i, k)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= l[(k, i)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
}
