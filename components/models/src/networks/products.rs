//! Products of matrices of `f32`, for batches of samples.
//!
//! Every entry is a sum in ascending order of the common dimension. Each term is added by a fused
//! multiply-add, which rounds once. The lanes of a vector contain different columns, so the bits depend
//! neither on other rows and columns nor on the width of the processor's instructions.

use core::array;

use pulp::{Arch, Simd, WithSimd};

/// Left factor of a product. Matrices are stored row by row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Left<'a> {
    /// The matrix.
    Rows(&'a [f32]),
    /// The transpose of the matrix.
    Columns(&'a [f32]),
}

/// The product of a left (rows x depth) and a right factor (depth x columns), added to a first row.
#[derive(Debug)]
pub(super) struct Product<'a> {
    pub(super) left: Left<'a>,
    pub(super) right: &'a [f32],
    /// Added to every row of the product; `None` adds nothing.
    pub(super) start: Option<&'a [f32]>,
    pub(super) depth: usize,
    /// Receives rows x columns numbers.
    pub(super) out: &'a mut [f32],
    pub(super) columns: usize,
}

impl Product<'_> {
    /// Computes the product.
    pub(super) fn compute(self) {
        if self.columns > 0 {
            Arch::new().dispatch(self);
        }
    }
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { left, right, start, depth, out, columns } = self;
        let rows = out.len() / columns;
        let mut matrices =
            Matrices { left, right: &right[..depth * columns], start, out, rows, depth, columns };
        let mut column = 0;
        while column < columns {
            // a block of columns of the right factor stays in the first cache for all rows
            column += match columns - column {
                rest if rest >= 2 * S::F32_LANES => matrices.block::<S, 2, false>(simd, column),
                rest if rest >= S::F32_LANES => matrices.block::<S, 1, false>(simd, column),
                _ => matrices.block::<S, 1, true>(simd, column),
            };
        }
    }
}

/// Factors and result of a product, and their sizes.
struct Matrices<'a> {
    left: Left<'a>,
    right: &'a [f32],
    start: Option<&'a [f32]>,
    out: &'a mut [f32],
    rows: usize,
    depth: usize,
    columns: usize,
}

impl Matrices<'_> {
    /// Computes `VECTORS` vectors of columns, or the remaining columns if `LAST`, for all rows; returns the
    /// number of columns.
    #[inline(always)]
    fn block<S: Simd, const VECTORS: usize, const LAST: bool>(&mut self, simd: S, column: usize) -> usize {
        let mut row = 0;
        // sums take half of the registers
        if S::REGISTER_COUNT >= 32 {
            while row + 8 <= self.rows {
                self.tile::<S, 8, VECTORS, LAST>(simd, row, column);
                row += 8;
            }
        }
        while row + 4 <= self.rows {
            self.tile::<S, 4, VECTORS, LAST>(simd, row, column);
            row += 4;
        }
        while row < self.rows {
            self.tile::<S, 1, VECTORS, LAST>(simd, row, column);
            row += 1;
        }
        VECTORS * S::F32_LANES
    }

    #[inline(always)]
    fn tile<S: Simd, const ROWS: usize, const VECTORS: usize, const LAST: bool>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    ) {
        let (rows, depth) = (self.rows, self.depth);
        let sums = match self.left {
            Left::Rows(left) => {
                let lines: [&[f32]; ROWS] = array::from_fn(
                    #[inline(always)]
                    |r| &left[(row + r) * depth..][..depth],
                );
                self.sums::<S, ROWS, VECTORS, LAST>(
                    simd,
                    column,
                    #[inline(always)]
                    |k, r| lines[r][k],
                )
            }
            Left::Columns(left) => {
                let left = &left[..rows * depth];
                self.sums::<S, ROWS, VECTORS, LAST>(
                    simd,
                    column,
                    #[inline(always)]
                    |k, r| left[k * rows + row..][..ROWS][r],
                )
            }
        };
        for (r, sums) in sums.into_iter().enumerate() {
            let out = &mut self.out[(row + r) * self.columns + column..];
            store::<S, VECTORS, LAST>(simd, &mut out[..self.columns - column], sums);
        }
    }

    /// Computes the sums of `ROWS` rows with the left factors `left(k, row)`.
    #[inline(always)]
    fn sums<S: Simd, const ROWS: usize, const VECTORS: usize, const LAST: bool>(
        &self,
        simd: S,
        column: usize,
        left: impl Fn(usize, usize) -> f32,
    ) -> [[S::f32s; VECTORS]; ROWS] {
        let (columns, right) = (self.columns, self.right);
        let first = match self.start {
            Some(start) => load::<S, VECTORS, LAST>(simd, &start[column..columns]),
            None => [simd.splat_f32s(0.0); VECTORS],
        };
        let mut sums = [first; ROWS];
        for k in 0..self.depth {
            let right = load::<S, VECTORS, LAST>(simd, &right[k * columns + column..(k + 1) * columns]);
            for (r, sums) in sums.iter_mut().enumerate() {
                let factor = simd.splat_f32s(left(k, r));
                for (sum, right) in sums.iter_mut().zip(right) {
                    *sum = simd.mul_add_f32s(factor, right, *sum);
                }
            }
        }
        sums
    }
}

/// Loads the first vectors of `numbers`, or all numbers if `LAST`.
#[inline(always)]
fn load<S: Simd, const VECTORS: usize, const LAST: bool>(simd: S, numbers: &[f32]) -> [S::f32s; VECTORS] {
    if LAST {
        [simd.partial_load_f32s(numbers); VECTORS]
    } else {
        let vectors = S::as_simd_f32s(&numbers[..VECTORS * S::F32_LANES]).0;
        array::from_fn(
            #[inline(always)]
            |v| vectors[v],
        )
    }
}

/// Stores vectors loaded by [`load`].
#[inline(always)]
fn store<S: Simd, const VECTORS: usize, const LAST: bool>(
    simd: S,
    numbers: &mut [f32],
    values: [S::f32s; VECTORS],
) {
    if LAST {
        simd.partial_store_f32s(numbers, values[0]);
    } else {
        S::as_mut_simd_f32s(&mut numbers[..VECTORS * S::F32_LANES]).0.copy_from_slice(&values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: usize) -> Vec<f32> {
        (0..count).map(|k| (1.3 * (k + 7 * seed) as f32).sin() / (1 + k % 5) as f32).collect()
    }

    #[test]
    fn entries_are_ordered_sums_of_fused_products() {
        for (rows, depth, columns) in
            [(1, 1, 1), (64, 48, 128), (13, 5, 12), (9, 64, 33), (4, 0, 20), (21, 3, 17), (8, 7, 64)]
        {
            let (a, right) = (numbers(rows * depth, 1), numbers(depth * columns, 2));
            let bias = numbers(columns, 3);
            for (left, start) in [
                (Left::Rows(&a), Some(&bias[..])),
                (Left::Rows(&a), None),
                (Left::Columns(&a), Some(&bias[..])),
                (Left::Columns(&a), None),
            ] {
                let mut out = vec![f32::NAN; rows * columns];
                Product { left, right: &right, start, depth, out: &mut out, columns }.compute();
                for (index, found) in out.iter().enumerate() {
                    let (row, column) = (index / columns, index % columns);
                    let expected = (0..depth).fold(start.map_or(0.0, |bias| bias[column]), |sum, k| {
                        let factor = match left {
                            Left::Rows(a) => a[row * depth + k],
                            Left::Columns(a) => a[k * rows + row],
                        };
                        factor.mul_add(right[k * columns + column], sum)
                    });
                    assert_eq!(
                        found.to_bits(),
                        expected.to_bits(),
                        "{rows} {depth} {columns}: {row} {column}"
                    );
                }
            }
        }
    }
}
