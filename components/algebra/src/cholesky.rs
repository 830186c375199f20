//! The Cholesky factor of a symmetric positive definite matrix.

use pulp::Arch;

use super::Simd;
use super::tiles::{COLUMNS, Factor, Gram, InvertTriangle, ROWS, SolveColumns};

/// Error returned when a matrix to factorise is not positive definite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the matrix is not positive definite: pivot {row} of {size} is {pivot:e}, expected more than 0")]
pub struct NotPositiveDefinite {
    /// Index of the pivot's row, counted from 0.
    pub row: usize,
    /// Number of rows of the matrix.
    pub size: usize,
    /// Value of the pivot.
    pub pivot: f64,
}

/// The upper triangular factor `U` of `A = U^T U`, in reusable storage.
///
/// Sums are computed in a fixed order. No method allocates while the matrix fits the capacity.
///
/// ```
/// use motorium_algebra::Cholesky;
///
/// let mut factor = Cholesky::with_capacity(2);
/// factor.factorise(2, |row, out| out.copy_from_slice(&[[4.0, 2.0], [2.0, 3.0]][row][row..]))?;
/// let mut x = [8.0, 7.0];
/// factor.solve(&mut x);
/// assert!((x[0] - 1.25).abs() < 1e-15 && (x[1] - 1.5).abs() < 1e-15);
/// # Ok::<(), motorium_algebra::NotPositiveDefinite>(())
/// ```
#[derive(Clone, Debug)]
pub struct Cholesky {
    n: usize,
    stride: usize,
    factor: Vec<f64>,
    /// `U^-T`, computed by `inverse`.
    triangle: Vec<f64>,
    /// A removed row.
    removed: Vec<f64>,
    /// Right-hand sides, or the vectors of `weighted_inverse`.
    columns: Vec<f64>,
    arch: Arch,
}

/// With fewer right-hand sides, each is solved separately.
const FEW: usize = 4;

fn padded(n: usize) -> usize {
    let columns = n.max(1).next_multiple_of(COLUMNS);
    // rows that are a power of two apart compete for a few cache sets
    if columns.is_multiple_of(128) { columns + COLUMNS } else { columns }
}

impl Cholesky {
    /// Creates an empty factor for up to `capacity` rows.
    pub fn with_capacity(capacity: usize) -> Self {
        let stride = padded(capacity);
        let factor = vec![0.0; stride * stride];
        let removed = vec![0.0; stride];
        Self { n: 0, stride, factor, triangle: vec![], removed, columns: vec![], arch: Arch::new() }
    }

    /// Returns the number of rows of the matrix.
    pub fn size(&self) -> usize {
        self.n
    }

    /// Returns the distance between rows of [`inverse`](Self::inverse), in values.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Returns row `row` of `U`, starting at the diagonal.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.factor[row * self.stride + row..row * self.stride + self.n]
    }

    /// Factorises a matrix with `n` rows. `fill(i, values)` must write row `i` to `values`, starting at the
    /// diagonal.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] if a pivot is not positive. The factor is then empty.
    pub fn factorise(
        &mut self,
        n: usize,
        mut fill: impl FnMut(usize, &mut [f64]),
    ) -> Result<(), NotPositiveDefinite> {
        if n > self.stride {
            *self = Self::with_capacity(n);
        }
        let stride = self.stride;
        for (i, row) in self.factor.chunks_exact_mut(stride).enumerate() {
            if i < n {
                row[..i].fill(0.0);
                fill(i, &mut row[i..n]);
                row[n..].fill(0.0);
            } else {
                row.fill(0.0);
            }
        }
        self.n = n;
        let result = self.arch.dispatch(Factor { matrix: &mut self.factor, stride, n });
        result.map_err(|(row, pivot)| {
            self.n = 0;
            NotPositiveDefinite { row, size: n, pivot }
        })
    }

    /// Returns `ln |A|`.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.n).map(|i| self.factor[i * self.stride + i].ln()).sum::<f64>()
    }

    /// Writes the upper triangle of `A^-1` to `out`, whose rows are [`stride`](Self::stride) apart. Values
    /// left of the diagonal are unspecified.
    ///
    /// # Panics
    /// If the length of `out` is not `stride * stride`.
    pub fn inverse(&mut self, out: &mut [f64]) {
        self.weighted_inverse(1.0, &[], out);
    }

    /// Writes the upper triangle of `factor A^-1 - sum_d w_d w_d^T` to `out`, in the layout of
    /// [`inverse`](Self::inverse). `vectors` contains the vectors `w_d` one after the other.
    ///
    /// # Panics
    /// If the length of `out` is not `stride * stride`, or the length of `vectors` is not a multiple of the
    /// number of rows.
    pub fn weighted_inverse(&mut self, factor: f64, vectors: &[f64], out: &mut [f64]) {
        let (stride, n) = (self.stride, self.n);
        assert_eq!(out.len(), stride * stride, "length of the inverse");
        assert!(vectors.len().is_multiple_of(n.max(1)), "{} values in vectors of {n}", vectors.len());
        self.triangle.resize(stride * stride, 0.0);
        self.arch.dispatch(InvertTriangle { factor: &self.factor, inverse: &mut self.triangle, stride, n });
        self.columns.clear();
        self.columns.resize(vectors.len() / n.max(1) * stride, 0.0);
        for (row, vector) in self.columns.chunks_exact_mut(stride).zip(vectors.chunks_exact(n.max(1))) {
            row[..n].copy_from_slice(vector);
        }
        // padding rows of the last panel are products of zeros
        debug_assert!(n.next_multiple_of(ROWS) <= stride);
        let (triangle, subtracted) = (&self.triangle, &self.columns);
        self.arch.dispatch(Gram { triangle, factor, subtracted, out, stride, n });
    }

    /// Solves `A x = b` in place for several right-hand sides, stored one after the other. With about four or
    /// more right-hand sides, this is faster than calling [`solve`](Self::solve) for each of them.
    ///
    /// # Panics
    /// If the length of `x` is not a multiple of the number of rows.
    pub fn solve_all(&mut self, x: &mut [f64]) {
        let n = self.n.max(1);
        assert!(x.len().is_multiple_of(n), "{} values in right-hand sides of {n}", x.len());
        let count = x.len() / n;
        if count < FEW {
            x.chunks_exact_mut(n).for_each(|x| self.solve(x));
            return;
        }
        let width = count.next_multiple_of(COLUMNS);
        self.columns.clear();
        self.columns.resize(n.next_multiple_of(ROWS) * width, 0.0);
        for (d, x) in x.chunks_exact(n).enumerate() {
            self.columns.chunks_exact_mut(width).zip(x).for_each(|(row, x)| row[d] = *x);
        }
        let (factor, stride, columns) = (&self.factor[..], self.stride, &mut self.columns[..]);
        self.arch.dispatch(SolveColumns { factor, stride, n: self.n, columns, width });
        for (d, x) in x.chunks_exact_mut(n).enumerate() {
            self.columns.chunks_exact(width).zip(x).for_each(|(row, x)| *x = row[d]);
        }
    }

    /// Solves `A x = b` in place.
    ///
    /// # Panics
    /// If the length of `x` differs from the number of rows.
    pub fn solve(&self, x: &mut [f64]) {
        self.solve_lower(x);
        self.solve_upper(x);
    }

    /// Solves `U^T x = b` in place.
    ///
    /// # Panics
    /// If the length of `x` differs from the number of rows.
    pub fn solve_lower(&self, x: &mut [f64]) {
        assert_eq!(x.len(), self.n, "length of the right-hand side");
        let simd = Simd::from_arch(self.arch);
        for i in 0..self.n {
            let row = self.row(i);
            let (head, tail) = x[i..].split_at_mut(1);
            head[0] /= row[0];
            simd.add_scaled(-head[0], &row[1..], tail);
        }
    }

    /// Solves `U x = b` in place.
    ///
    /// # Panics
    /// If the length of `x` differs from the number of rows.
    pub fn solve_upper(&self, x: &mut [f64]) {
        assert_eq!(x.len(), self.n, "length of the right-hand side");
        let simd = Simd::from_arch(self.arch);
        for i in (0..self.n).rev() {
            let row = self.row(i);
            let (head, tail) = x[i..].split_at_mut(1);
            head[0] = (head[0] - simd.dot(&row[1..], tail)) / row[0];
        }
    }

    /// Appends a row and column to the matrix, in `O(n^2)`; `column` contains the entries above the diagonal.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] if the larger matrix is not positive definite. The factor is then unchanged.
    ///
    /// # Panics
    /// If the length of `column` differs from the number of rows.
    pub fn append(&mut self, column: &[f64], diagonal: f64) -> Result<(), NotPositiveDefinite> {
        assert_eq!(column.len(), self.n, "length of the column");
        if self.n == self.stride {
            self.grow();
        }
        let n = self.n;
        let mut solved = std::mem::take(&mut self.removed);
        solved[..n].copy_from_slice(column);
        self.solve_lower(&mut solved[..n]);
        let pivot = diagonal - Simd::from_arch(self.arch).dot(&solved[..n], &solved[..n]);
        let positive = pivot > 0.0 && pivot.is_finite();
        if positive {
            for (row, value) in self.factor.chunks_exact_mut(self.stride).zip(&solved[..n]) {
                row[n] = *value;
            }
            self.factor[n * self.stride + n] = pivot.sqrt();
            self.n += 1;
        }
        self.removed = solved;
        if positive { Ok(()) } else { Err(NotPositiveDefinite { row: n, size: n + 1, pivot }) }
    }

    /// Removes row and column `index` of the matrix, in `O(n^2)`.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn remove(&mut self, index: usize) {
        assert!(index < self.n, "row {index} of {}", self.n);
        let (n, stride) = (self.n, self.stride);
        self.removed[index + 1..n]
            .copy_from_slice(&self.factor[index * stride + index + 1..index * stride + n]);
        // rotations merge the removed row into the rows below: U'^T U' = U^T U + u u^T
        for i in index + 1..n {
            let row = &mut self.factor[i * stride..(i + 1) * stride];
            let (diagonal, other) = (row[i], self.removed[i]);
            let length = diagonal.hypot(other);
            let (cosine, sine) = (diagonal / length, other / length);
            for (y, v) in row[i..n].iter_mut().zip(&mut self.removed[i..n]) {
                (*y, *v) = (cosine * *y + sine * *v, cosine * *v - sine * *y);
            }
        }
        for i in 0..n {
            let row = &mut self.factor[i * stride..(i + 1) * stride];
            row.copy_within(index + 1..n, index);
            row[n - 1] = 0.0;
        }
        self.factor.copy_within((index + 1) * stride..n * stride, index * stride);
        self.factor[(n - 1) * stride..n * stride].fill(0.0);
        self.n -= 1;
    }

    fn grow(&mut self) {
        let mut larger = Self::with_capacity(2 * self.n);
        let rows = larger.factor.chunks_exact_mut(larger.stride).zip(self.factor.chunks_exact(self.stride));
        for (to, from) in rows.take(self.n) {
            to[..self.n].copy_from_slice(&from[..self.n]);
        }
        larger.n = self.n;
        *self = larger;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn positive(n: usize) -> DMatrix<f64> {
        let noise = DMatrix::from_fn(n, n, |i, j| (1.3 * (i * n + j) as f64 + 0.1).sin());
        &noise * noise.transpose() + DMatrix::identity(n, n)
    }

    fn factorised(matrix: &DMatrix<f64>) -> Cholesky {
        let mut factor = Cholesky::with_capacity(1);
        let fill = |i: usize, out: &mut [f64]| {
            out.iter_mut().enumerate().for_each(|(j, out)| *out = matrix[(i, i + j)]);
        };
        factor.factorise(matrix.nrows(), fill).expect("positive definite");
        factor
    }

    fn product(factor: &Cholesky) -> DMatrix<f64> {
        let n = factor.size();
        let upper = DMatrix::from_fn(n, n, |i, j| if j < i { 0.0 } else { factor.row(i)[j - i] });
        upper.transpose() * upper
    }

    #[test]
    fn factors_and_inverses_of_all_sizes_agree() {
        for n in (1..40).chain([127, 128, 129, 200]) {
            let matrix = positive(n);
            let mut factor = factorised(&matrix);
            assert!((product(&factor) - &matrix).norm() < 1e-14 * n as f64 * matrix.norm(), "{n}");
            let stride = factor.stride();
            let mut inverse = vec![f64::NAN; stride * stride];
            factor.inverse(&mut inverse);
            let full = |upper: &[f64]| DMatrix::from_fn(n, n, |i, j| upper[i.min(j) * stride + i.max(j)]);
            let found = full(&inverse);
            let error = (&matrix * &found - DMatrix::identity(n, n)).norm();
            assert!(error < 1e-11 * n as f64, "{n}: {error:e}");
            let vectors: Vec<f64> = (0..3 * n).map(|i| (0.3 * i as f64).sin()).collect();
            factor.weighted_inverse(2.0, &vectors, &mut inverse);
            let vectors = DMatrix::from_column_slice(n, 3, &vectors);
            let expected = 2.0 * found - &vectors * vectors.transpose();
            assert!((full(&inverse) - &expected).norm() < 1e-14 * n as f64 * expected.norm(), "{n}");
            let determinant = matrix.clone().cholesky().expect("positive").determinant().ln();
            if determinant.is_finite() {
                assert!((factor.log_determinant() - determinant).abs() < 1e-10 * determinant.abs().max(1.0));
            }
        }
    }

    #[test]
    fn solutions_satisfy_the_equations() {
        let matrix = positive(37);
        let factor = factorised(&matrix);
        let b: Vec<f64> = (0..37).map(|i| (0.4 * f64::from(i)).cos()).collect();
        let mut x = b.clone();
        factor.solve(&mut x);
        let residual = &matrix * nalgebra::DVector::from_vec(x) - nalgebra::DVector::from_vec(b);
        assert!(residual.norm() < 1e-12, "{:e}", residual.norm());
    }

    #[test]
    fn solve_all_matches_single_solves() {
        for (n, count) in [(1, 5), (8, 4), (37, 14), (64, 1), (129, 33)] {
            let mut factor = factorised(&positive(n));
            let b: Vec<f64> = (0..n * count).map(|i| (0.4 * i as f64).cos()).collect();
            let (mut all, mut single) = (b.clone(), b);
            factor.solve_all(&mut all);
            single.chunks_exact_mut(n).for_each(|x| factor.solve(x));
            let largest = single.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            assert!(all.iter().zip(&single).all(|(a, b)| (a - b).abs() < 1e-11 * largest), "{n} x {count}");
        }
    }

    #[test]
    fn appended_and_removed_rows_equal_a_new_factor() {
        let matrix = positive(50);
        let mut factor = factorised(&matrix.view((0, 0), (3, 3)).into_owned());
        for n in 3..50 {
            factor.append(&matrix.column(n).as_slice()[..n], matrix[(n, n)]).expect("positive");
        }
        assert!((product(&factor) - &matrix).norm() < 1e-12 * matrix.norm());
        for index in [49, 0, 17, 17, 45] {
            let before = product(&factor);
            factor.remove(index);
            let expected = before.remove_row(index).remove_column(index);
            assert!((product(&factor) - &expected).norm() < 1e-13 * expected.norm(), "{index}");
        }
        assert_eq!(factor.size(), 45);
        factor.append(&[0.0; 45], 1.0).expect("positive");
        assert!((product(&factor)[(45, 45)] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn indefinite_matrices_name_the_pivot() {
        let mut factor = Cholesky::with_capacity(6);
        let fill = |i: usize, out: &mut [f64]| {
            out.fill(0.0);
            out[0] = if i == 4 { -2.0 } else { 1.0 };
        };
        let error = factor.factorise(6, fill).expect_err("indefinite");
        assert_eq!(error, NotPositiveDefinite { row: 4, size: 6, pivot: -2.0 });
        let error = factor.factorise(2, |_, out| out.fill(f64::NAN)).expect_err("not finite");
        assert_eq!((error.row, factor.size()), (0, 0));
        factor.factorise(1, |_, out| out[0] = 4.0).expect("positive");
        assert!(factor.append(&[4.0], 4.0).is_err());
        assert_eq!(factor.row(0), [2.0]);
    }
}
