//! A symmetric matrix of 3 x 3 blocks.

use nalgebra::Matrix3;

/// A symmetric matrix of 3 x 3 blocks, stored in full. Nothing allocates after [`new`](Self::new).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Blocks {
    n: usize,
    blocks: Vec<Matrix3<f64>>,
}

impl Blocks {
    /// Creates `n` by `n` zero blocks.
    pub(super) fn new(n: usize) -> Self {
        Self { n, blocks: vec![Matrix3::zeros(); n * n] }
    }

    pub(super) fn count(&self) -> usize {
        self.n
    }

    pub(super) fn get(&self, row: usize, column: usize) -> &Matrix3<f64> {
        &self.blocks[row * self.n + column]
    }

    pub(super) fn get_mut(&mut self, row: usize, column: usize) -> &mut Matrix3<f64> {
        &mut self.blocks[row * self.n + column]
    }

    pub(super) fn clear(&mut self) {
        self.blocks.fill(Matrix3::zeros());
    }

    /// Sets the rows and columns of a block to zero.
    pub(super) fn clear_block(&mut self, index: usize) {
        for other in 0..self.n {
            *self.get_mut(index, other) = Matrix3::zeros();
            *self.get_mut(other, index) = Matrix3::zeros();
        }
    }

    /// Copies the covariances of block `from` to block `to`, including its own covariance.
    pub(super) fn copy_block(&mut self, from: usize, to: usize) {
        for other in 0..self.n {
            if other != to {
                *self.get_mut(to, other) = *self.get(from, other);
                *self.get_mut(other, to) = *self.get(other, from);
            }
        }
        *self.get_mut(to, to) = *self.get(from, from);
    }

    /// Adds `factor` times row `from` to row `to`, then the same for the columns: `E P E'` with
    /// `E = 1 + factor` at `(to, from)`. `from` and `to` differ.
    pub(super) fn add_multiple(&mut self, to: usize, from: usize, factor: &Matrix3<f64>) {
        for other in 0..self.n {
            let part = factor * self.get(from, other);
            *self.get_mut(to, other) += part;
        }
        let transposed = factor.transpose();
        for other in 0..self.n {
            let part = self.get(other, from) * transposed;
            *self.get_mut(other, to) += part;
        }
    }

    /// Restores exact symmetry.
    pub(super) fn symmetrize(&mut self) {
        for row in 0..self.n {
            for column in row..self.n {
                let mean = (self.get(row, column) + self.get(column, row).transpose()) * 0.5;
                *self.get_mut(row, column) = mean;
                *self.get_mut(column, row) = mean.transpose();
            }
        }
    }
}
