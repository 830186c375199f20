//! Dense layers on batches.

use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::products::{Left, Product};

/// A matrix and a bias.
#[derive(Clone, Debug)]
pub(super) struct Dense {
    pub(super) inputs: usize,
    /// Weights of the first input, then of the second.
    pub(super) weights: Vec<f32>,
    /// The same weights, output by output.
    pub(super) by_output: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

impl Dense {
    /// Creates a layer with weights (outputs x inputs) and zero bias.
    pub(super) fn new(weights: &DMatrix<f32>) -> Self {
        let (outputs, inputs) = weights.shape();
        Self {
            inputs,
            weights: weights.as_slice().to_vec(),
            by_output: weights.transpose().as_slice().to_vec(),
            bias: vec![0.0; outputs],
        }
    }

    pub(super) fn outputs(&self) -> usize {
        self.bias.len()
    }

    pub(super) fn parameters(&self) -> usize {
        self.weights.len() + self.bias.len()
    }

    /// Replaces weights and bias.
    pub(super) fn set(&mut self, parameters: &[f32]) {
        let (weights, bias) = parameters.split_at(self.weights.len());
        self.weights.copy_from_slice(weights);
        self.bias.copy_from_slice(bias);
        let outputs = self.outputs();
        for (output, row) in self.by_output.chunks_exact_mut(self.inputs).enumerate() {
            let column = weights.iter().skip(output).step_by(outputs);
            row.iter_mut().zip(column).for_each(|(weight, known)| *weight = *known);
        }
    }

    /// Writes the output.
    pub(super) fn forward(&self, input: &DMatrix<f32>, output: &mut DMatrix<f32>) {
        resize(output, self.outputs(), input.ncols());
        Product {
            left: Left::Rows(input.as_slice()),
            right: &self.weights,
            start: Some(&self.bias),
            depth: self.inputs,
            out: output.as_mut_slice(),
            columns: self.outputs(),
        }
        .compute();
    }

    /// Writes the gradient with respect to weights and bias from the gradient with respect to the output.
    pub(super) fn gradients(&self, input: &DMatrix<f32>, output: &DMatrix<f32>, gradients: &mut [f32]) {
        let (weights, bias) = gradients.split_at_mut(self.weights.len());
        Product {
            left: Left::Columns(input.as_slice()),
            right: output.as_slice(),
            start: None,
            depth: output.ncols(),
            out: weights,
            columns: self.outputs(),
        }
        .compute();
        bias.fill(0.0);
        for sample in output.as_slice().chunks_exact(self.outputs()) {
            bias.iter_mut().zip(sample).for_each(|(sum, gradient)| *sum += gradient);
        }
    }

    /// Writes the gradient with respect to the input from the gradient with respect to the output.
    pub(super) fn backward(&self, output: &DMatrix<f32>, input: &mut DMatrix<f32>) {
        resize(input, self.inputs, output.ncols());
        Product {
            left: Left::Rows(output.as_slice()),
            right: &self.by_output,
            start: None,
            depth: self.outputs(),
            out: input.as_mut_slice(),
            columns: self.inputs,
        }
        .compute();
    }
}

/// Resizes a matrix; keeps its memory if the shape is unchanged.
pub(super) fn resize(matrix: &mut DMatrix<f32>, rows: usize, columns: usize) {
    if matrix.shape() != (rows, columns) {
        *matrix = DMatrix::zeros(rows, columns);
    }
}

/// Returns a uniformly distributed matrix with orthonormal rows or columns.
pub(super) fn orthogonal(rows: usize, columns: usize, random: &mut Pcg64) -> DMatrix<f32> {
    let (long, short) = (rows.max(columns), rows.min(columns));
    let normal = DMatrix::<f64>::from_fn(long, short, |_, _| StandardNormal.sample(random));
    let (mut q, r) = normal.qr().unpack();
    for (mut column, diagonal) in q.column_iter_mut().zip(r.diagonal().iter()) {
        if *diagonal < 0.0 {
            column.neg_mut();
        }
    }
    let q = q.map(|entry| entry as f32);
    if rows >= columns { q } else { q.transpose() }
}
