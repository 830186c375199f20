//! Products of panels of rows, by tiles that stay in registers.
//!
//! Every sum runs over the rows in ascending order, with fused multiply-adds where the machine has them, so a
//! result does not depend on the width of the instructions.

use std::ops::Range;

use pulp::{Simd, WithSimd};

/// Rows of a tile.
pub(super) const ROWS: usize = 4;
/// Columns of a row are padded to a multiple of this number: two of the widest registers.
pub(super) const COLUMNS: usize = 16;

/// `sum_k a[k][row + r] b[k][column + c]` for the rows `k` of `depth`; columns count in registers.
#[inline(always)]
fn tile<S: Simd>(
    simd: S,
    (a, stride): (&[f64], usize),
    row: usize,
    b: &[S::f64s],
    column: usize,
    depth: Range<usize>,
) -> [[S::f64s; 2]; ROWS] {
    let lanes = S::F64_LANES;
    let width = stride / lanes;
    let mut sums = [[simd.splat_f64s(0.0); 2]; ROWS];
    if depth.is_empty() {
        return sums;
    }
    let a = a[depth.start * stride..depth.end * stride].chunks_exact(stride);
    let b = b[depth.start * width..depth.end * width].chunks_exact(width);
    for (a, b) in a.zip(b) {
        let b = &b[column..column + 2];
        for (factor, sums) in a[row..row + ROWS].iter().zip(&mut sums) {
            let factor = simd.splat_f64s(*factor);
            sums[0] = simd.mul_add_f64s(factor, b[0], sums[0]);
            sums[1] = simd.mul_add_f64s(factor, b[1], sums[1]);
        }
    }
    sums
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

/// Overwrites the upper triangle of a symmetric matrix with `U` of `U^T U`; the pivot and its row if it is
/// not positive.
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
            let vectors = S::as_simd_f64s(above).0;
            let start = first / COLUMNS * COLUMNS;
            for column in (start / S::F64_LANES..width).step_by(2) {
                let sums = tile(simd, (above, stride), first, vectors, column, 0..first);
                for (row, sums) in panel.chunks_exact_mut(stride).zip(sums) {
                    let row = &mut S::as_mut_simd_f64s(row).0[column..column + 2];
                    row[0] = simd.sub_f64s(row[0], sums[0]);
                    row[1] = simd.sub_f64s(row[1], sums[1]);
                }
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
        inverse.fill(0.0);
        for first in (0..n).step_by(ROWS) {
            let (above, panel) = inverse.split_at_mut(first * stride);
            let panel = &mut panel[..ROWS * stride];
            let vectors = S::as_simd_f64s(above).0;
            let end = (first / COLUMNS + 1) * COLUMNS;
            for column in (0..first.div_ceil(lanes)).step_by(2) {
                // the rows above the diagonal are zero in these columns
                let sums = tile(simd, (factor, stride), first, vectors, column, column * lanes..first);
                for (row, sums) in panel.chunks_exact_mut(stride).zip(sums) {
                    let row = &mut S::as_mut_simd_f64s(row).0[column..column + 2];
                    row[0] = simd.sub_f64s(row[0], sums[0]);
                    row[1] = simd.sub_f64s(row[1], sums[1]);
                }
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

/// The lower triangle of `V^T V`, for a lower triangular `V`.
pub(super) struct Gram<'a> {
    pub(super) triangle: &'a [f64],
    pub(super) out: &'a mut [f64],
    pub(super) stride: usize,
    pub(super) n: usize,
}

impl WithSimd for Gram<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { triangle, out, stride, n } = self;
        let vectors = S::as_simd_f64s(triangle).0;
        for first in (0..n).step_by(ROWS) {
            let panel = &mut out[first * stride..(first + ROWS) * stride];
            for column in (0..(first + ROWS).div_ceil(S::F64_LANES)).step_by(2) {
                let sums = tile(simd, (triangle, stride), first, vectors, column, first..n);
                for (row, sums) in panel.chunks_exact_mut(stride).zip(sums) {
                    S::as_mut_simd_f64s(row).0[column..column + 2].copy_from_slice(&sums);
                }
            }
        }
    }
}
