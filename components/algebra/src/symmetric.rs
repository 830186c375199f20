//! Eigenvalues and eigenvectors of a symmetric matrix by divide and conquer.

use nalgebra::DMatrix;

use super::Simd;
use super::secular::eigen_of_rank_one_update;
use super::tridiagonal::Tridiagonal;

/// Size below which a tridiagonal matrix is solved directly.
const DIRECT: usize = 24;

/// Eigenvalues, descending, and orthonormal eigenvectors of a symmetric matrix.
#[derive(Clone, Debug)]
pub struct SymmetricEigen {
    /// Eigenvalues, in descending order.
    pub values: Vec<f64>,
    /// Eigenvectors, one per column, in the order of the values.
    pub vectors: DMatrix<f64>,
}

/// Solves the eigenproblem of a symmetric matrix; only the lower triangle is read.
///
/// # Panics
/// If the matrix is not square.
pub fn symmetric_eigen(matrix: DMatrix<f64>) -> SymmetricEigen {
    let solved = Decomposed::new(matrix);
    SymmetricEigen { vectors: solved.vectors(0, solved.values.len()), values: solved.values }
}

/// A solved eigenproblem whose vectors are computed on request.
pub(super) struct Decomposed {
    /// Eigenvalues, the largest first.
    pub(super) values: Vec<f64>,
    reduced: Tridiagonal,
    /// Eigenvectors of the tridiagonal matrix, the smallest eigenvalue first.
    inner: DMatrix<f64>,
    simd: Simd,
}

impl Decomposed {
    pub(super) fn new(matrix: DMatrix<f64>) -> Self {
        assert!(matrix.is_square(), "{:?} is not square", matrix.shape());
        let simd = Simd::new();
        let reduced = Tridiagonal::new(matrix, simd);
        let (mut values, inner) = divide(reduced.diagonal.clone(), &reduced.beside);
        values.reverse();
        Self { values, reduced, inner, simd }
    }

    /// Returns the eigenvectors of `count` eigenvalues, starting with the `first`.
    pub(super) fn vectors(&self, first: usize, count: usize) -> DMatrix<f64> {
        let n = self.values.len();
        let mut vectors = DMatrix::zeros(n, count);
        for k in 0..count {
            vectors.set_column(k, &self.inner.column(n - 1 - first - k));
        }
        self.reduced.apply(&mut vectors, self.simd);
        vectors
    }
}

/// Computes eigenvalues, ascending, and eigenvectors of a tridiagonal matrix.
fn divide(mut diagonal: Vec<f64>, beside: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
    let n = diagonal.len();
    if n <= DIRECT {
        return direct(&diagonal, beside);
    }
    // Divided at the middle; the coupling remains as an outer product.
    let middle = n / 2;
    let coupling = beside[middle - 1];
    let strength = coupling.abs();
    diagonal[middle - 1] -= strength;
    diagonal[middle] -= strength;
    let second = diagonal.split_off(middle);
    let (first_values, first) = divide(diagonal, &beside[..middle - 1]);
    let (second_values, second) = divide(second, &beside[middle..]);
    let root = strength.sqrt();
    let mut entries: Vec<(f64, f64, usize)> = Vec::with_capacity(n);
    for (k, value) in first_values.into_iter().enumerate() {
        entries.push((value, root * first[(middle - 1, k)], k));
    }
    for (k, value) in second_values.into_iter().enumerate() {
        entries.push((value, root.copysign(coupling) * second[(0, k)], middle + k));
    }
    entries.sort_by(|a, b| a.0.total_cmp(&b.0));
    let d: Vec<f64> = entries.iter().map(|entry| entry.0).collect();
    let z: Vec<f64> = entries.iter().map(|entry| entry.1).collect();
    let update = eigen_of_rank_one_update(&d, &z);
    // The basis of each half multiplies only the rows of that half.
    let mut upper = DMatrix::zeros(middle, n);
    let mut lower = DMatrix::zeros(n - middle, n);
    for (row, entry) in entries.iter().enumerate() {
        let values = update.vectors.row(row);
        if entry.2 < middle {
            upper.set_row(entry.2, &values);
        } else {
            lower.set_row(entry.2 - middle, &values);
        }
    }
    let mut vectors = DMatrix::zeros(n, n);
    vectors.rows_mut(0, middle).gemm(1.0, &first, &upper, 0.0);
    vectors.rows_mut(middle, n - middle).gemm(1.0, &second, &lower, 0.0);
    (update.values, vectors)
}

/// Solves a small tridiagonal matrix directly.
fn direct(diagonal: &[f64], beside: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
    let n = diagonal.len();
    let mut full = DMatrix::zeros(n, n);
    for (k, value) in diagonal.iter().enumerate() {
        full[(k, k)] = *value;
    }
    for (k, value) in beside.iter().enumerate() {
        full[(k + 1, k)] = *value;
        full[(k, k + 1)] = *value;
    }
    let solved = full.symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| solved.eigenvalues[*a].total_cmp(&solved.eigenvalues[*b]));
    let vectors = DMatrix::from_fn(n, n, |i, k| solved.eigenvectors[(i, order[k])]);
    (order.iter().map(|k| solved.eigenvalues[*k]).collect(), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(matrix: &DMatrix<f64>) {
        let n = matrix.nrows();
        let found = symmetric_eigen(matrix.clone());
        let values = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(found.values.clone()));
        let error = (matrix * &found.vectors - &found.vectors * values).norm() / matrix.norm();
        let skew = (found.vectors.transpose() * &found.vectors - DMatrix::identity(n, n)).norm();
        assert!(error < 1e-14 * (n as f64).sqrt() * 4.0, "residual {error:e} of {n}");
        assert!(skew < 1e-13 * n as f64, "{skew:e} from orthonormal of {n}");
        assert!(found.values.is_sorted_by(|a, b| a >= b));
    }

    #[test]
    fn matrices_of_all_kinds_are_diagonalised() {
        for n in [1, 2, 5, 24, 25, 60, 131] {
            let noise = DMatrix::from_fn(n, n, |i, j| (1.3 * (i * n + j) as f64 + 0.1).sin());
            check(&(&noise * noise.transpose()));
            check(&(&noise + noise.transpose()));
            check(&(DMatrix::identity(n, n) * 2.0));
            let low = noise.columns(0, 1.max(n / 10));
            check(&(low * low.transpose()));
            check(&DMatrix::from_fn(n, n, |i, j| {
                if i == j {
                    2.0
                } else if i.abs_diff(j) == 1 {
                    -1.0
                } else {
                    0.0
                }
            }));
        }
    }

    #[test]
    fn second_difference_matrix_has_known_eigenvalues() {
        let n = 100;
        let matrix = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        let found = symmetric_eigen(matrix).values;
        for (k, value) in found.iter().rev().enumerate() {
            let known = 4.0 * (std::f64::consts::PI * (k + 1) as f64 / (2.0 * (n + 1) as f64)).sin().powi(2);
            assert!((value - known).abs() < 1e-14, "{k}: {value} {known}");
        }
    }
}
