//! Sums, means and maxima over parts of a tensor, and operations based on them.

use pulp::{Arch, Simd, WithSimd};

use crate::arithmetic::Real;

/// Operation that reduces the numbers of a part to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduction {
    /// Their mean, summed in order.
    Mean,
    /// The largest.
    Max,
}

/// Parts of a tensor by offsets: the numbers of output `k` are `offsets[starts[k]..starts[k + 1]]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// First offset of each part, and the end of the last part.
    pub starts: Vec<u32>,
    /// Offsets of the numbers.
    pub offsets: Vec<u32>,
}

impl Reduction {
    /// Writes one number for each part.
    pub fn apply(self, parts: &Parts, input: &[f32], output: &mut [f32]) {
        for (range, output) in parts.starts.windows(2).zip(output) {
            let numbers = parts.offsets[range[0] as usize..range[1] as usize].iter();
            let numbers = numbers.map(|offset| input[*offset as usize]);
            *output = match self {
                Self::Mean => numbers.sum::<f32>() / (range[1] - range[0]) as f32,
                Self::Max => {
                    numbers.fold(f32::NEG_INFINITY, |max, x| if x > max || x.is_nan() { x } else { max })
                }
            };
        }
    }
}

/// Sizes of a tensor before, along and after one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Along {
    /// Product of the lengths before the axis.
    pub outer: usize,
    /// Length of the axis.
    pub length: usize,
    /// Product of the lengths after the axis.
    pub inner: usize,
}

/// Normalised exponentials along an axis.
#[derive(Debug)]
pub struct Softmax<'a> {
    /// The axis.
    pub along: Along,
    /// The tensor.
    pub input: &'a [f32],
    /// The result.
    pub output: &'a mut [f32],
}

impl WithSimd for Softmax<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Along { length, inner, .. } = self.along;
        let blocks =
            self.input.chunks_exact(length * inner).zip(self.output.chunks_exact_mut(length * inner));
        for (input, output) in blocks {
            for column in 0..inner {
                let max = (0..length).fold(f32::NEG_INFINITY, |max, k| max.max(input[k * inner + column]));
                let mut sum = 0.0;
                for k in 0..length {
                    let value = Real::exp(input[k * inner + column] - max);
                    output[k * inner + column] = value;
                    sum += value;
                }
                for k in 0..length {
                    output[k * inner + column] /= sum;
                }
            }
        }
    }
}

impl Along {
    /// Writes 1 at the first largest number along the axis, 0 elsewhere.
    pub fn hardmax(self, input: &[f32], output: &mut [f32]) {
        let Self { length, inner, .. } = self;
        output.fill(0.0);
        let blocks = input.chunks_exact(length * inner).zip(output.chunks_exact_mut(length * inner));
        for (input, output) in blocks {
            for column in 0..inner {
                let value = |k: usize| input[k * inner + column];
                let largest = (1..length).fold(0, |best, k| if value(k) > value(best) { k } else { best });
                output[largest * inner + column] = 1.0;
            }
        }
    }
}

/// Rows of mean 0 and variance 1, scaled and shifted.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerNorm {
    /// Factor of each column.
    pub scale: Vec<f32>,
    /// Offset of each column.
    pub shift: Vec<f32>,
    /// Constant added to the variance.
    pub epsilon: f32,
}

impl LayerNorm {
    /// Normalises each row.
    pub fn apply(&self, arch: Arch, input: &[f32], output: &mut [f32]) {
        arch.dispatch(Normalise { norm: self, input, output });
    }
}

struct Normalise<'a> {
    norm: &'a LayerNorm,
    input: &'a [f32],
    output: &'a mut [f32],
}

impl WithSimd for Normalise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let LayerNorm { scale, shift, epsilon } = self.norm;
        let n = scale.len();
        for (input, output) in self.input.chunks_exact(n).zip(self.output.chunks_exact_mut(n)) {
            let mean = input.iter().sum::<f32>() / n as f32;
            let square = input.iter().fold(0.0, |sum, x| (x - mean).mul_add(x - mean, sum));
            let factor = 1.0 / (square / n as f32 + epsilon).sqrt();
            for (((output, x), scale), shift) in output.iter_mut().zip(input).zip(scale).zip(shift) {
                *output = (x - mean) * factor * scale + shift;
            }
        }
    }
}

/// A factor and an offset for each channel (batch normalisation with fixed statistics).
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    /// Factor of each channel.
    pub scale: Vec<f32>,
    /// Offset of each channel.
    pub shift: Vec<f32>,
    /// Number of consecutive numbers of a channel.
    pub inner: usize,
}

impl Affine {
    /// Scales and shifts all channels.
    pub fn apply(&self, input: &[f32], output: &mut [f32]) {
        let Self { scale, shift, inner } = self;
        let channels = input.chunks_exact(*inner).zip(output.chunks_exact_mut(*inner));
        for ((input, output), (scale, shift)) in channels.zip(scale.iter().zip(shift).cycle()) {
            for (output, x) in output.iter_mut().zip(input) {
                *output = x * scale + shift;
            }
        }
    }
}
