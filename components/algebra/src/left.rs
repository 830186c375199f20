//! Singular values and left singular vectors.

use nalgebra::DMatrix;

use super::symmetric::Decomposed;

/// Selection of singular vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// All singular vectors whose singular values exceed rounding.
    All,
    /// At most this number of singular vectors.
    Rank(usize),
    /// The smallest number of vectors that leaves at most this fraction of the matrix's energy (the sum of
    /// the squared singular values) to the omitted vectors.
    Residual(f64),
}

/// Left singular vectors and singular values of a matrix.
#[derive(Clone, Debug)]
pub struct LeftSingular {
    /// Orthonormal left singular vectors, one per column. Vectors whose singular values do not exceed
    /// rounding errors are omitted, even if they were requested.
    pub vectors: DMatrix<f64>,
    /// Singular values of these vectors, in descending order.
    pub values: Vec<f64>,
    /// All singular values, in descending order. A value without a vector has an error of about 1e-13 times
    /// the largest value.
    pub spectrum: Vec<f64>,
    /// Sum of the squares of all entries of the matrix.
    pub energy: f64,
}

/// Singular values below this fraction of the largest are computed from a separate Gram matrix.
const SCALE: f64 = 1e-3;
/// Singular values below this fraction of the largest are rounding errors.
const ROUNDING: f64 = 1e-15;

/// Computes the leading left singular vectors of a matrix.
///
/// The vectors are computed from the Gram matrix of the matrix's shorter side. A Gram matrix contains
/// squares, so it resolves a singular value `s` only to `eps s_1^2 / s`, where `s_1` is the largest singular
/// value. Therefore only vectors with `s >= 1e-3 s_1` are computed from it. The matrix is then projected onto
/// the complement of these vectors, and the next vectors are computed in the same way until enough are found.
/// All singular values with a vector are accurate to a few `eps s_1`, as with a direct method. A tall matrix
/// is first reduced to its triangular factor by a QR decomposition.
pub fn left_singular(matrix: &DMatrix<f64>, wanted: Wanted) -> LeftSingular {
    let (rows, columns) = matrix.shape();
    if rows == 0 || columns == 0 {
        return LeftSingular {
            vectors: DMatrix::zeros(rows, 0),
            values: vec![],
            spectrum: vec![],
            energy: 0.0,
        };
    }
    if rows > columns {
        let qr = matrix.clone().qr();
        let mut inner = left_singular(&qr.r(), wanted);
        inner.vectors = qr.q() * inner.vectors;
        return inner;
    }
    let energy = matrix.norm_squared();
    let mut found =
        LeftSingular { vectors: DMatrix::zeros(rows, 0), values: vec![], spectrum: vec![], energy };
    descend(matrix, None, &mut found, wanted);
    // at the boundary between levels, rounding can leave two nearly equal singular values out of order
    let mut order: Vec<usize> = (0..found.values.len()).collect();
    order.sort_by(|a, b| found.values[*b].total_cmp(&found.values[*a]));
    let kept = count_wanted(&order.iter().map(|k| found.values[*k]).collect::<Vec<_>>(), energy, wanted);
    found.vectors = DMatrix::from_fn(rows, kept, |i, k| found.vectors[(i, order[k])]);
    found.values = order[..kept].iter().map(|k| found.values[*k]).collect();
    found.spectrum.sort_by(|a, b| b.total_cmp(a));
    found
}

/// Returns the number of singular values that `wanted` selects. `values` contains all singular values in
/// descending order, and `energy` is the sum of the squares of all matrix entries.
pub fn count_wanted(values: &[f64], energy: f64, wanted: Wanted) -> usize {
    match wanted {
        Wanted::All => values.len(),
        Wanted::Rank(rank) => rank.min(values.len()),
        Wanted::Residual(part) => {
            // summed from the smallest value, to avoid cancellation
            let squares: f64 = values.iter().rev().map(|s| s * s).sum();
            let mut left = (energy - squares).max(0.0) + squares;
            for (k, value) in values.iter().enumerate() {
                if left <= part * energy {
                    return k.max(1).min(values.len());
                }
                left -= value * value;
            }
            values.len()
        }
    }
}

/// Processes one scale of singular values, the singular values of `basis^T matrix`. `basis` spans the
/// complement of the previous scales.
fn descend(matrix: &DMatrix<f64>, basis: Option<&DMatrix<f64>>, found: &mut LeftSingular, wanted: Wanted) {
    let projected = basis.map(|basis| basis.transpose() * matrix);
    let here = projected.as_ref().unwrap_or(matrix);
    let solved = Decomposed::new(here * here.transpose());
    let roots: Vec<f64> = solved.values.iter().map(|value| value.max(0.0).sqrt()).collect();
    let largest = found.values.first().copied().unwrap_or(roots[0]);
    let head = roots.iter().take_while(|root| **root > roots[0] * SCALE).count();
    if roots[0] <= ROUNDING * largest || head == 0 {
        found.spectrum.extend(roots);
        return;
    }
    // at most the selected number, plus one that shows that it suffices
    let known = found.values.len();
    let ahead: Vec<f64> = found.values.iter().chain(&roots[..head]).copied().collect();
    let count = (count_wanted(&ahead, found.energy, wanted) + 1).saturating_sub(known).clamp(1, head);
    let vectors = solved.vectors(0, count);
    // the norm of a row is exact to second order in the error of its vector
    let rows = vectors.transpose() * here;
    let values: Vec<f64> = (0..count).map(|k| rows.row(k).norm()).collect();
    found.spectrum.extend_from_slice(&values);
    found.values.extend_from_slice(&values);
    let outer = basis.map_or_else(|| vectors.clone(), |basis| basis * &vectors);
    let all = std::mem::replace(&mut found.vectors, DMatrix::zeros(0, 0));
    found.vectors = all.resize_horizontally(known + count, 0.0);
    found.vectors.columns_mut(known, count).copy_from(&outer);
    let rest = roots.len() - head;
    if rest == 0 || count < head || wanted == Wanted::Rank(known + count) {
        found.spectrum.extend_from_slice(&roots[count..]);
        return;
    }
    let tail = solved.vectors(head, rest);
    let tail = basis.map_or_else(|| tail.clone(), |basis| basis * &tail);
    descend(matrix, Some(&tail), found, wanted);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a matrix with known singular values.
    fn graded(rows: usize, columns: usize, values: &[f64]) -> DMatrix<f64> {
        let noise =
            |n: usize, seed: f64| DMatrix::from_fn(n, n, |i, j| (seed * (i * n + j) as f64 + 0.3).sin());
        let (u, v) = (noise(rows, 1.7).qr().q(), noise(columns, 2.3).qr().q());
        let middle = DMatrix::from_fn(rows, columns, |i, j| if i == j { values[i] } else { 0.0 });
        u * middle * v.transpose()
    }

    #[test]
    fn singular_values_are_exact_over_many_scales() {
        let values: Vec<f64> = (0..40).map(|k| 10.0_f64.powf(-0.3 * f64::from(k))).collect();
        for (rows, columns) in [(40, 40), (40, 90), (90, 40)] {
            let matrix = graded(rows, columns, &values);
            let found = left_singular(&matrix, Wanted::All);
            assert_eq!(found.values.len(), 40);
            for (found, known) in found.values.iter().zip(&values) {
                assert!((found - known).abs() < 2e-14, "{found:e} {known:e}");
            }
            let u = &found.vectors;
            assert!((u.tr_mul(u) - DMatrix::identity(40, 40)).norm() < 1e-12);
            assert!((&matrix - u * u.tr_mul(&matrix)).norm() < 1e-13);
        }
    }

    #[test]
    fn residual_determines_the_number_of_vectors() {
        let matrix = graded(6, 8, &[3.0, 2.0, 1.0, 0.1, 0.01, 1e-5]);
        assert_eq!(left_singular(&matrix, Wanted::Residual(0.1)).values.len(), 2);
        assert_eq!(left_singular(&matrix, Wanted::Residual(1e-3)).values.len(), 3);
        assert_eq!(left_singular(&matrix, Wanted::Residual(0.0)).values.len(), 6);
        assert_eq!(left_singular(&matrix, Wanted::Rank(4)).values.len(), 4);
    }

    #[test]
    fn low_rank_matrix_has_as_many_vectors_as_its_rank() {
        let matrix = graded(30, 50, &[&[2.0, 1.0][..], &[0.0; 28]].concat());
        let found = left_singular(&matrix, Wanted::All);
        assert!(found.values.len() >= 2 && found.values[1] > 0.99);
        assert!(found.values.iter().skip(2).all(|value| *value < 1e-14));
    }
}
