//! Products of panels of rows, by tiles that are kept in registers.
//!
//! Every sum runs over the rows in ascending order, with fused multiply-adds if the machine supports them, so
//! a result does not depend on the width of the instructions.

use std::array;
use std::ops::Range;

use pulp::{Simd, WithSimd};

/// Rows of a panel.
pub(super) const ROWS: usize = 8;
/// Rows are padded to a multiple of this number of columns: two of the widest registers.
pub(super) const COLUMNS: usize = 16;

/// Left factor of a product: entry `(k, r)` of the transposed rows `row..` of a matrix, or of the rows
/// themselves.
#[derive(Clone, Copy)]
enum Left<'a> {
    /// `a[k][row + r]`.
    Columns(&'a [f64]),
    /// `a[row + r][k]`.
    Rows(&'a [f64]),
}

/// The matrices of a product: `sum_k left(k, r) right[k][c]`.
#[derive(Clone, Copy)]
struct Product<'a, V> {
    left: Left<'a>,
    /// Distance between rows of the left matrix, in values.
    stride: usize,
    right: &'a [V],
    /// Distance between rows of the right matrix, in registers.
    width: usize,
}

impl<V: Copy> Product<'_, V> {
    /// Computes the products of the `ROWS` rows from `row` with two registers from `column`, each a sum over
    /// `depth`, and passes them to `finish` row by row.
    #[inline(always)]
    fn panel<S: Simd<f64s = V>>(
        self,
        simd: S,
        row: usize,
        column: usize,
        depth: Range<usize>,
        mut finish: impl FnMut(usize, [V; 2]),
    ) {
        // the sums of eight rows fill half of 32 wide registers, the sums of four rows half of 16
        if S::F64_LANES == 8 {
            let sums = self.tile::<S, ROWS>(simd, row, column, depth);
            for (r, sums) in sums.into_iter().enumerate() {
                finish(r, sums);
            }
        } else {
            for half in [0, ROWS / 2] {
                let sums = self.tile::<S, { ROWS / 2 }>(simd, row + half, column, depth.clone());
                for (r, sums) in sums.into_iter().enumerate() {
                    finish(half + r, sums);
                }
            }
        }
    }

    #[inline(always)]
    fn tile<S: Simd<f64s = V>, const R: usize>(
        self,
        simd: S,
        row: usize,
        column: usize,
        depth: Range<usize>,
    ) -> [[V; 2]; R] {
        let mut sums = [[simd.splat_f64s(0.0); 2]; R];
        if depth.is_empty() {
            return sums;
        }
        let right = self.right[depth.start * self.width..depth.end * self.width].chunks_exact(self.width);
        let right = right.map(|right| &right[column..column + 2]);
        match self.left {
            Left::Columns(left) => {
                let left = left[depth.start * self.stride..depth.end * self.stride].chunks_exact(self.stride);
                for (left, right) in left.zip(right) {
                    for (factor, sums) in left[row..row + R].iter().zip(&mut sums) {
                        add(simd, *factor, right, sums);
                    }
                }
            }
            Left::Rows(left) => {
                let rows: [&[f64]; R] =
                    array::from_fn(|r| &left[(row + r) * self.stride..][depth.start..depth.end]);
                for (k, right) in right.enumerate() {
                    for (left, sums) in rows.iter().zip(&mut sums) {
                        add(simd, left[k], right, sums);
                    }
                }
            }
        }
        sums
    }
}

/// `sums += factor * right`.
#[inline(always)]
fn add<S: Simd>(simd: S, factor: f64, right: &[S::f64s], sums: &mut [S::f64s; 2]) {
    let factor = simd.splat_f64s(factor);
    sums[0] = simd.mul_add_f64s(factor, right[0], sums[0]);
    sums[1] = simd.mul_add_f64s(factor, right[1], sums[1]);
}

/// `row -= factor * other`.
#[inline(always)]
fn subtract<S: Simd>(simd: S, factor: f64, other: &[f64], row: &mut [f64]) {
    let factor = simd.splat_f64s(-factor);
    for (y, x) in S::as_mut_simd_f64s(row).0.iter_mut().zip(S::as_simd_f64s(other).0) {
        *y = simd.mul_add_f64s(factor, *x, *y);
    }
}

#[inline(always)]
fn scale<S: Simd>(simd: S, factor: f64, row: &mut [f64]) {
    let factor = simd.splat_f64s(factor);
    for y in S::as_mut_simd_f64s(row).0 {
        *y = simd.mul_f64s(factor, *y);
    }
}

/// Two registers of row `row` of a matrix.
#[inline(always)]
fn pair<S: Simd>(matrix: &mut [f64], stride: usize, row: usize, column: usize) -> &mut [S::f64s] {
    &mut S::as_mut_simd_f64s(&mut matrix[row * stride..(row + 1) * stride]).0[column..column + 2]
}

/// Overwrites the upper triangle of a symmetric matrix with `U` of `U^T U`. Returns the pivot and its row if
/// it is not positive.
pub(super) struct Factor<'a> {
    pub(super) matrix: &'a mut [f64],
    pub(super) stride: usize,
    pub(super) n: usize,
}

impl WithSimd for Factor<'_> {
    type Output = Result<(), (usize, f64)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { matrix, stride, n } = self;
        let width = stride / S::F64_LANES;
        for first in (0..n).step_by(ROWS) {
            let (above, panel) = matrix.split_at_mut(first * stride);
            let panel = &mut panel[..ROWS * stride];
            let product =
                Product { left: Left::Columns(above), stride, right: S::as_simd_f64s(above).0, width };
            let start = first / COLUMNS * COLUMNS;
            for column in (start / S::F64_LANES..width).step_by(2) {
                product.panel(
                    simd,
                    first,
                    column,
                    0..first,
                    #[inline(always)]
                    |r, sums| {
                        let row = pair::<S>(panel, stride, r, column);
                        row[0] = simd.sub_f64s(row[0], sums[0]);
                        row[1] = simd.sub_f64s(row[1], sums[1]);
                    },
                );
            }
            for r in 0..ROWS.min(n - first) {
                let (done, rest) = panel.split_at_mut(r * stride);
                let row = &mut rest[..stride];
                for other in done.chunks_exact(stride) {
                    subtract(simd, other[first + r], &other[start..], &mut row[start..]);
                }
                let pivot = row[first + r];
                if !(pivot > 0.0 && pivot.is_finite()) {
                    return Err((first + r, pivot));
                }
                scale(simd, 1.0 / pivot.sqrt(), &mut row[start..]);
                row[first + r] = pivot.sqrt();
                row[..first + r].fill(0.0);
            }
        }
        Ok(())
    }
}

/// `V = U^-T`, lower triangular, row by row.
pub(super) struct InvertTriangle<'a> {
    pub(super) factor: &'a [f64],
    pub(super) inverse: &'a mut [f64],
    pub(super) stride: usize,
    pub(super) n: usize,
}

impl WithSimd for InvertTriangle<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { factor, inverse, stride, n } = self;
        let lanes = S::F64_LANES;
        for first in (0..n).step_by(ROWS) {
            let (above, panel) = inverse.split_at_mut(first * stride);
            let panel = &mut panel[..ROWS * stride];
            panel.fill(0.0);
            let right = S::as_simd_f64s(above).0;
            let product = Product { left: Left::Columns(factor), stride, right, width: stride / lanes };
            let end = (first / COLUMNS + 1) * COLUMNS;
            for column in (0..first.div_ceil(lanes)).step_by(2) {
                // the rows above the diagonal are zero in these columns
                product.panel(
                    simd,
                    first,
                    column,
                    column * lanes..first,
                    #[inline(always)]
                    |r, sums| {
                        let row = pair::<S>(panel, stride, r, column);
                        row[0] = simd.neg_f64s(sums[0]);
                        row[1] = simd.neg_f64s(sums[1]);
                    },
                );
            }
            for r in 0..ROWS.min(n - first) {
                let (done, rest) = panel.split_at_mut(r * stride);
                let row = &mut rest[..stride];
                row[first + r] += 1.0;
                for (s, other) in done.chunks_exact(stride).enumerate() {
                    let coupling = factor[(first + s) * stride + first + r];
                    subtract(simd, coupling, &other[..end], &mut row[..end]);
                }
                scale(simd, 1.0 / factor[(first + r) * stride + first + r], &mut row[..end]);
            }
            // padding rows of the last panel
            for row in panel.chunks_exact_mut(stride).skip(n - first) {
                row.fill(0.0);
            }
        }
    }
}

/// Computes the upper triangle of `factor V^T V - W^T W`, for a lower triangular `V` and a few rows `W`.
pub(super) struct Gram<'a> {
    pub(super) triangle: &'a [f64],
    pub(super) factor: f64,
    pub(super) subtracted: &'a [f64],
    pub(super) out: &'a mut [f64],
    pub(super) stride: usize,
    pub(super) n: usize,
}

impl WithSimd for Gram<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { triangle, factor, subtracted, out, stride, n } = self;
        let lanes = S::F64_LANES;
        let product = |a| Product {
            left: Left::Columns(a),
            stride,
            right: S::as_simd_f64s(a).0,
            width: stride / lanes,
        };
        let (triangle, few) = (product(triangle), product(subtracted));
        let count = subtracted.len() / stride;
        let factor = simd.splat_f64s(factor);
        for first in (0..n).step_by(ROWS) {
            let panel = &mut out[first * stride..(first + ROWS) * stride];
            let start = first / COLUMNS * COLUMNS / lanes;
            for column in (start..n.div_ceil(lanes)).step_by(2) {
                // the rows of the triangle above its diagonal are zero in these columns
                triangle.panel(
                    simd,
                    first,
                    column,
                    (column * lanes).min(n)..n,
                    #[inline(always)]
                    |r, sums| {
                        let row = pair::<S>(panel, stride, r, column);
                        row[0] = simd.mul_f64s(factor, sums[0]);
                        row[1] = simd.mul_f64s(factor, sums[1]);
                    },
                );
                if count > 0 {
                    few.panel(
                        simd,
                        first,
                        column,
                        0..count,
                        #[inline(always)]
                        |r, sums| {
                            let row = pair::<S>(panel, stride, r, column);
                            row[0] = simd.sub_f64s(row[0], sums[0]);
                            row[1] = simd.sub_f64s(row[1], sums[1]);
                        },
                    );
                }
            }
        }
    }
}

/// Solves `U^T U X = B` in place; the rows of `B` are `width` apart, a multiple of `COLUMNS`, and padded to a
/// multiple of `ROWS`.
pub(super) struct SolveColumns<'a> {
    pub(super) factor: &'a [f64],
    pub(super) stride: usize,
    pub(super) n: usize,
    pub(super) columns: &'a mut [f64],
    pub(super) width: usize,
}

impl WithSimd for SolveColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { factor, stride, n, columns, width } = self;
        let registers = width / S::F64_LANES;
        let diagonal = |row: usize| 1.0 / factor[row * stride + row];
        for first in (0..n).step_by(ROWS) {
            let (above, panel) = columns.split_at_mut(first * width);
            let right = S::as_simd_f64s(above).0;
            let product = Product { left: Left::Columns(factor), stride, right, width: registers };
            for column in (0..registers).step_by(2) {
                product.panel(
                    simd,
                    first,
                    column,
                    0..first,
                    #[inline(always)]
                    |r, sums| {
                        let row = pair::<S>(panel, width, r, column);
                        row[0] = simd.sub_f64s(row[0], sums[0]);
                        row[1] = simd.sub_f64s(row[1], sums[1]);
                    },
                );
            }
            for r in 0..ROWS.min(n - first) {
                let (done, rest) = panel.split_at_mut(r * width);
                let row = &mut rest[..width];
                for (s, other) in done.chunks_exact(width).enumerate() {
                    subtract(simd, factor[(first + s) * stride + first + r], other, row);
                }
                scale(simd, diagonal(first + r), row);
            }
        }
        for first in (0..n).step_by(ROWS).rev() {
            let (panel, below) = columns[first * width..].split_at_mut(ROWS * width);
            let end = (first + ROWS).min(n);
            let right = S::as_simd_f64s(below).0;
            let product = Product { left: Left::Rows(&factor[end..]), stride, right, width: registers };
            for column in (0..registers).step_by(2) {
                product.panel(
                    simd,
                    first,
                    column,
                    0..n - end,
                    #[inline(always)]
                    |r, sums| {
                        let row = pair::<S>(panel, width, r, column);
                        row[0] = simd.sub_f64s(row[0], sums[0]);
                        row[1] = simd.sub_f64s(row[1], sums[1]);
                    },
                );
            }
            for r in (0..end - first).rev() {
                let (rest, done) = panel.split_at_mut((r + 1) * width);
                let row = &mut rest[r * width..];
                for (s, other) in (r + 1..end - first).zip(done.chunks_exact(width)) {
                    subtract(simd, factor[(first + r) * stride + first + s], other, row);
                }
                scale(simd, diagonal(first + r), row);
            }
        }
    }
}
