//! The motions left free by the levels above.

use nalgebra::{DMatrix, DVector};

/// A direction is free if its component in the rows of a level is smaller than this, relative to the longest
/// row.
const UNSEEN: f64 = 1e-7;

/// Weighted rows `W A` of the tasks of one level, and `W b`, with a fixed capacity.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Transposed, so that a row is a contiguous column: n x capacity.
    transposed: DMatrix<f64>,
    /// `W b`.
    desired: DVector<f64>,
    count: usize,
}

impl Rows {
    /// Creates a buffer for `most` rows over `variables` unknowns.
    pub(crate) fn new(variables: usize, most: usize) -> Self {
        Self { transposed: DMatrix::zeros(variables, most), desired: DVector::zeros(most), count: 0 }
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Iterates over the rows with their targets.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&[f64], f64)> {
        let rows = self.transposed.as_slice().chunks_exact(self.transposed.nrows().max(1));
        rows.zip(self.desired.iter().copied()).take(self.count)
    }

    /// Appends a zero row whose entry of `W b` is `desired`, and returns the row for writing.
    ///
    /// # Panics
    /// If the rows exceed the capacity, because a task writes more rows than declared.
    pub fn push(&mut self, desired: f64) -> &mut [f64] {
        self.desired[self.count] = desired;
        let variables = self.transposed.nrows();
        let row = &mut self.transposed.as_mut_slice()[self.count * variables..][..variables];
        row.fill(0.0);
        self.count += 1;
        row
    }
}

/// A basis of the motions that no level has determined so far; orthonormal if all motions were free
/// initially.
#[derive(Clone, Debug)]
pub(crate) struct Freedom {
    /// n x n; the first `count` columns are the basis, the others zero.
    basis: DMatrix<f64>,
    count: usize,
    /// The rows of a level in the coordinates of the basis, one row a column: n x most.
    seen: DMatrix<f64>,
    /// A product with the basis, n.
    product: DVector<f64>,
}

impl Freedom {
    pub(crate) fn new(variables: usize, most_rows: usize) -> Self {
        Self {
            basis: DMatrix::identity(variables, variables),
            count: variables,
            seen: DMatrix::zeros(variables, most_rows),
            product: DVector::zeros(variables),
        }
    }

    /// Makes every motion free.
    pub(crate) fn open(&mut self) {
        self.basis.fill_with_identity();
        self.count = self.basis.nrows();
    }

    /// Makes the motions spanned by the columns of `map` free, n x at most n.
    pub(crate) fn open_to(&mut self, map: &DMatrix<f64>) {
        self.basis.fill(0.0);
        self.basis.columns_mut(0, map.ncols()).copy_from(map);
        self.count = map.ncols();
    }

    /// Number of free directions.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The basis, followed by zero columns.
    pub(crate) fn basis(&self) -> &DMatrix<f64> {
        &self.basis
    }

    /// Removes the directions that `rows` determine.
    ///
    /// Householder reflections with pivoting rotate the basis so that its first columns span the row space;
    /// those columns are dropped. Golub and Van Loan, *Matrix Computations*, 4th edition, 5.4.2.
    pub(crate) fn close(&mut self, rows: &Rows) {
        let (n, open, count) = (self.basis.nrows(), self.count, rows.count);
        let mut longest = 0.0_f64;
        for row in 0..count {
            let given = rows.transposed.column(row);
            longest = longest.max(given.norm());
            for direction in 0..open {
                self.seen[(direction, row)] = self.basis.column(direction).dot(&given);
            }
        }
        let least = UNSEEN * longest;
        let mut closed = 0;
        while closed < open.min(count) {
            let left = |row: &usize| self.seen.view((closed, *row), (open - closed, 1)).norm_squared();
            let Some(pivot) = (closed..count).max_by(|a, b| left(a).total_cmp(&left(b))) else { break };
            let length = left(&pivot).sqrt();
            if length <= least {
                break;
            }
            self.seen.swap_columns(closed, pivot);
            // reflection that maps the remainder of this row to the first remaining direction
            let first = self.seen[(closed, closed)];
            self.seen[(closed, closed)] = first + length.copysign(first);
            let scale = 2.0 / self.seen.view((closed, closed), (open - closed, 1)).norm_squared();
            let (done, mut rest) = self.seen.columns_range_pair_mut(closed..=closed, closed + 1..count);
            let mirror = done.view((closed, 0), (open - closed, 1));
            for mut row in rest.column_iter_mut() {
                let mut row = row.view_mut((closed, 0), (open - closed, 1));
                let share = scale * row.dot(&mirror);
                row.zip_apply(&mirror, |row, mirror| *row -= share * mirror);
            }
            self.product.fill(0.0);
            for (place, mirror) in mirror.iter().enumerate() {
                self.product.axpy(*mirror, &self.basis.column(closed + place), 1.0);
            }
            for (place, mirror) in mirror.iter().enumerate() {
                self.basis.column_mut(closed + place).axpy(-scale * mirror, &self.product, 1.0);
            }
            closed += 1;
        }
        // free directions come first
        let data = self.basis.as_mut_slice();
        data.copy_within(closed * n..open * n, 0);
        data[(open - closed) * n..open * n].fill(0.0);
        self.count = open - closed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(given: &[&[f64]]) -> Rows {
        let mut rows = Rows::new(given[0].len(), given.len());
        for row in given {
            rows.push(0.0).copy_from_slice(row);
        }
        rows
    }

    /// Asserts that the basis is orthonormal and orthogonal to the rows.
    fn check(freedom: &Freedom, rows: &Rows) {
        let basis = freedom.basis.columns(0, freedom.count);
        let gram = basis.transpose() * basis;
        assert!((gram - DMatrix::identity(freedom.count, freedom.count)).amax() < 1e-14);
        let seen = rows.transposed.columns(0, rows.count).transpose() * basis;
        assert!(seen.iter().all(|seen| seen.abs() < 1e-12), "{seen}");
        assert!(freedom.basis.columns_range(freedom.count..).iter().all(|number| *number == 0.0));
    }

    #[test]
    fn only_independent_rows_remove_directions() {
        let (one, two): (&[f64], &[f64]) = (&[1.0, 2.0, 0.5, -1.0], &[0.3, -1.0, 2.0, 0.7]);
        let sum: Vec<f64> = one.iter().zip(two).map(|(a, b)| 2.0 * a - b).collect();
        for (given, open) in [
            (rows(&[one]), 3),
            (rows(&[one, two]), 2),
            (rows(&[one, two, &sum]), 2),
            (rows(&[&[0.0; 4]]), 4),
            (rows(&[&[1.0, 0.0, 0.0, 0.0], &[0.0, 1e-9, 0.0, 0.0]]), 3),
        ] {
            let mut freedom = Freedom::new(4, 3);
            freedom.close(&given);
            assert_eq!(freedom.count(), open);
            if open != 3 || given.count == 1 {
                check(&freedom, &given);
            }
        }
    }

    #[test]
    fn levels_remove_directions_until_none_is_free() {
        let mut freedom = Freedom::new(3, 2);
        for (level, open) in
            [(rows(&[&[1.0, 1.0, 0.0]]), 2), (rows(&[&[1.0, 1.0, 1.0], &[2.0, 2.0, 0.0]]), 1)]
        {
            freedom.close(&level);
            assert_eq!(freedom.count(), open);
            check(&freedom, &level);
        }
        freedom.close(&rows(&[&[1.0, 0.0, 0.0]]));
        assert_eq!(freedom.count(), 0);
        freedom.close(&rows(&[&[1.0, 0.0, 0.0]]));
        assert_eq!(freedom.count(), 0);
        freedom.open();
        assert_eq!(freedom.count(), 3);
        check(&freedom, &Rows::new(3, 0));
    }
}
