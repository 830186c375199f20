//! Layer and batch normalisation.

use super::{Backward, Forward, Layer};
use crate::arithmetic::Real;

/// A layer that normalises each row to mean 0 and variance 1, then applies a factor and an offset to each
/// column. Parameters: all factors, then all offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerNorm {
    /// Number of values per row.
    pub width: usize,
    /// Constant added to the variance.
    pub epsilon: f64,
}

/// A layer that normalises each column to mean 0 and variance 1 over the rows of the batch, then applies a
/// factor and an offset to each column. Parameters: all factors, then all offsets. For inference, use running
/// statistics instead of the statistics of a batch, as `BatchNormalization` of ONNX does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchNorm {
    /// Number of values per row.
    pub width: usize,
    /// Constant added to the variance.
    pub epsilon: f64,
}

/// Returns mean and reciprocal standard deviation of `count` numbers.
fn statistics<T: Real>(numbers: impl Iterator<Item = T> + Clone, count: usize, epsilon: f64) -> (T, T) {
    let count = T::from_f64(count as f64);
    let mean = numbers.clone().fold(T::default(), |sum, x| sum + x) / count;
    let square = numbers.fold(T::default(), |sum, x| (x - mean).mul_add(x - mean, sum));
    (mean, T::from_f64(1.0) / (square / count + T::from_f64(epsilon)).sqrt())
}

/// Computes the gradients with respect to numbers that were normalised together, from the gradients with
/// respect to the normalised numbers.
fn backward<T: Real>(
    (input, gradient): (impl Iterator<Item = T> + Clone, impl Iterator<Item = T> + Clone),
    (mean, factor): (T, T),
    count: usize,
) -> impl Iterator<Item = T> {
    let count = T::from_f64(count as f64);
    let centred = input.map(move |x| (x - mean) * factor);
    let sum = gradient.clone().fold(T::default(), |sum, g| sum + g) / count;
    let pairs = centred.clone().zip(gradient.clone());
    let product = pairs.fold(T::default(), |sum, (x, g)| x.mul_add(g, sum)) / count;
    centred.zip(gradient).map(move |(x, g)| factor * (g - sum - x * product))
}

impl Layer for LayerNorm {
    fn inputs(&self) -> usize {
        self.width
    }

    fn outputs(&self) -> usize {
        self.width
    }

    fn parameters(&self) -> usize {
        2 * self.width
    }

    fn trace(&self) -> usize {
        2
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let n = self.width;
        let (scale, shift) = pass.parameters.split_at(n);
        let rows = pass.input.chunks_exact(n).zip(pass.output.chunks_exact_mut(n));
        for ((input, output), trace) in rows.zip(pass.trace.chunks_exact_mut(2)) {
            let (mean, factor) = statistics(input.iter().copied(), n, self.epsilon);
            (trace[0], trace[1]) = (mean, factor);
            for k in 0..n {
                output[k] = (input[k] - mean) * factor * scale[k] + shift[k];
            }
        }
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let n = self.width;
        let scale = &pass.parameters[..n];
        let rows = pass.input.chunks_exact(n).zip(pass.gradient.chunks_exact(n));
        let rows = rows.zip(pass.trace.chunks_exact(2));
        for (((input, gradient), trace), out) in rows.zip(pass.input_gradient.chunks_exact_mut(n)) {
            let (mean, factor) = (trace[0], trace[1]);
            for k in 0..n {
                pass.parameter_gradient[k] += gradient[k] * (input[k] - mean) * factor;
                pass.parameter_gradient[n + k] += gradient[k];
            }
            let scaled = gradient.iter().zip(scale).map(|(g, s)| *g * *s);
            let found = backward((input.iter().copied(), scaled), (mean, factor), n);
            out.iter_mut().zip(found).for_each(|(out, g)| *out = g);
        }
    }
}

impl Layer for BatchNorm {
    fn inputs(&self) -> usize {
        self.width
    }

    fn outputs(&self) -> usize {
        self.width
    }

    fn parameters(&self) -> usize {
        2 * self.width
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let n = self.width;
        let rows = pass.input.len() / n;
        for k in 0..n {
            let column = pass.input.iter().skip(k).step_by(n).copied();
            let (mean, factor) = statistics(column.clone(), rows, self.epsilon);
            for (output, x) in pass.output.iter_mut().skip(k).step_by(n).zip(column) {
                *output = (x - mean) * factor * pass.parameters[k] + pass.parameters[n + k];
            }
        }
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let n = self.width;
        let rows = pass.input.len() / n;
        for k in 0..n {
            let column = pass.input.iter().skip(k).step_by(n).copied();
            let gradient = pass.gradient.iter().skip(k).step_by(n).copied();
            let (mean, factor) = statistics(column.clone(), rows, self.epsilon);
            for (x, g) in column.clone().zip(gradient.clone()) {
                pass.parameter_gradient[k] += g * (x - mean) * factor;
                pass.parameter_gradient[n + k] += g;
            }
            let scale = pass.parameters[k];
            let found = backward((column, gradient.map(move |g| g * scale)), (mean, factor), rows);
            pass.input_gradient.iter_mut().skip(k).step_by(n).zip(found).for_each(|(out, g)| *out = g);
        }
    }
}
