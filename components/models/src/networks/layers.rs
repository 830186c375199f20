//! Layers on batches: a batch is a matrix with one sample per column.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

/// Side of a convolution kernel.
pub(super) const KERNEL: usize = 5;

/// A matrix and a bias: dense, or the kernels of a convolution.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    pub(super) weights: DMatrix<f32>,
    pub(super) bias: DVector<f32>,
}

/// Gradients of a [`Linear`].
#[derive(Clone, Debug)]
pub(super) struct Gradients {
    pub(super) weights: DMatrix<f32>,
    pub(super) bias: DVector<f32>,
}

impl Linear {
    /// Creates random weights for ReLU units (He et al. 2015).
    pub(super) fn random(outputs: usize, inputs: usize, random: &mut Pcg64) -> Self {
        let scale = (2.0 / inputs as f32).sqrt();
        let mut normal = || {
            let value: f32 = StandardNormal.sample(random);
            scale * value
        };
        let weights = DMatrix::from_fn(outputs, inputs, |_, _| normal());
        Self { weights, bias: DVector::zeros(outputs) }
    }

    pub(super) fn forward(&self, input: &DMatrix<f32>) -> DMatrix<f32> {
        let mut out = &self.weights * input;
        out.column_iter_mut().for_each(|mut column| column += &self.bias);
        out
    }

    pub(super) fn gradients(&self, input: &DMatrix<f32>, output: &DMatrix<f32>) -> Gradients {
        Gradients { weights: output * input.transpose(), bias: output.column_sum() }
    }

    /// Returns the gradient with respect to the input, computed from the gradient with respect to the output.
    pub(super) fn backward(&self, output: &DMatrix<f32>) -> DMatrix<f32> {
        self.weights.transpose() * output
    }
}

/// Sets negative numbers to 0.
pub(super) fn relu(values: &mut DMatrix<f32>) {
    values.iter_mut().for_each(|value| *value = value.max(0.0));
}

/// Zeroes the gradient of units whose output was 0.
pub(super) fn relu_backward(gradient: &mut DMatrix<f32>, output: &DMatrix<f32>) {
    gradient.iter_mut().zip(output.iter()).for_each(|(g, y)| {
        if *y <= 0.0 {
            *g = 0.0;
        }
    });
}

/// Returns the patches under a kernel, one per column: `channels 5 5` rows, all positions of the first sample
/// first.
pub(super) fn patches(input: &DMatrix<f32>, channels: usize, side: usize) -> DMatrix<f32> {
    let out = side - KERNEL + 1;
    let mut patches = DMatrix::zeros(channels * KERNEL * KERNEL, input.ncols() * out * out);
    let mut columns = patches.as_mut_slice().chunks_exact_mut(channels * KERNEL * KERNEL);
    for sample in input.column_iter() {
        let sample = sample.as_slice();
        for row in 0..out {
            for column in 0..out {
                let patch = columns.next().expect("one column for each place");
                for (line, piece) in patch.chunks_exact_mut(KERNEL).enumerate() {
                    let (channel, line) = (line / KERNEL, line % KERNEL);
                    let from = channel * side * side + (row + line) * side + column;
                    piece.copy_from_slice(&sample[from..from + KERNEL]);
                }
            }
        }
    }
    patches
}

/// Applies the transpose of [`patches`]: sums the gradients of patches at their source positions.
pub(super) fn from_patches(
    patches: &DMatrix<f32>,
    channels: usize,
    side: usize,
    samples: usize,
) -> DMatrix<f32> {
    let out = side - KERNEL + 1;
    let mut input = DMatrix::zeros(channels * side * side, samples);
    let mut columns = patches.as_slice().chunks_exact(channels * KERNEL * KERNEL);
    for sample in input.as_mut_slice().chunks_exact_mut(channels * side * side) {
        for row in 0..out {
            for column in 0..out {
                let patch = columns.next().expect("one column for each place");
                for (line, piece) in patch.chunks_exact(KERNEL).enumerate() {
                    let (channel, line) = (line / KERNEL, line % KERNEL);
                    let from = channel * side * side + (row + line) * side + column;
                    for (x, p) in sample[from..from + KERNEL].iter_mut().zip(piece) {
                        *x += p;
                    }
                }
            }
        }
    }
    input
}

/// Returns the maximum of each 2 x 2 block, from `channels` rows and one column per position to one column
/// per sample, and the positions of the maxima (offsets in the input) for the backward pass.
pub(super) fn pool(input: &DMatrix<f32>, side: usize) -> (DMatrix<f32>, Vec<u32>) {
    let (channels, half) = (input.nrows(), side / 2);
    let samples = input.ncols() / (side * side);
    let mut out = DMatrix::zeros(channels * half * half, samples);
    let mut places = vec![0; out.len()];
    let values = input.as_slice();
    for (k, (value, place)) in out.as_mut_slice().iter_mut().zip(&mut places).enumerate() {
        let (sample, within) = (k / (channels * half * half), k % (channels * half * half));
        let (channel, row, column) = (within / (half * half), within / half % half, within % half);
        let corner = sample * side * side + 2 * row * side + 2 * column;
        *value = f32::NEG_INFINITY;
        for at in [corner, corner + 1, corner + side, corner + side + 1] {
            let from = at * channels + channel;
            if values[from] > *value {
                (*value, *place) = (values[from], from as u32);
            }
        }
    }
    (out, places)
}

/// Returns the gradient before [`pool`], a matrix of `shape`.
pub(super) fn pool_backward(gradient: &DMatrix<f32>, places: &[u32], shape: (usize, usize)) -> DMatrix<f32> {
    let mut out = DMatrix::zeros(shape.0, shape.1);
    let values: &mut [f32] = out.as_mut_slice();
    gradient.iter().zip(places).for_each(|(g, place)| values[*place as usize] += g);
    out
}
