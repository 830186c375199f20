//! Means and maxima over parts of a tensor, softmax, and normalisation.

use pulp::{Arch, Simd, WithSimd};

use crate::arithmetic::Real;

/// Returns the sum, added in order.
#[inline(always)]
fn sum<T: Real>(numbers: impl Iterator<Item = T>) -> T {
    numbers.fold(T::from_f32(-0.0), |sum, x| sum + x)
}

/// Operation that reduces the numbers of a part to one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduction {
    /// Mean; the numbers are added in order.
    Mean,
    /// Maximum.
    Max,
}

/// Parts of a tensor, given by offsets: part `k` consists of the numbers at `offsets[starts[k]..starts[k +
/// 1]]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Index in `offsets` of the start of each part, followed by the end of the last part.
    pub starts: Vec<u32>,
    /// Offsets of the numbers in the tensor.
    pub offsets: Vec<u32>,
}

impl Reduction {
    /// Reduces each part of `input` to one number of `output`.
    pub fn apply<T: Real>(self, parts: &Parts, input: &[T], output: &mut [T]) {
        for (range, output) in parts.starts.windows(2).zip(output) {
            let numbers = parts.offsets[range[0] as usize..range[1] as usize].iter();
            let numbers = numbers.map(|offset| input[*offset as usize]);
            *output = match self {
                Self::Mean => sum(numbers) / T::from_f32((range[1] - range[0]) as f32),
                Self::Max => {
                    let least = T::from_f32(f32::NEG_INFINITY);
                    numbers.fold(least, |max, x| if x > max || x.is_nan() { x } else { max })
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

/// Softmax (normalised exponentials) along an axis.
#[derive(Debug)]
pub struct Softmax<'a, T = f32> {
    /// Axis of the tensor.
    pub along: Along,
    /// Input tensor.
    pub input: &'a [T],
    /// Output tensor.
    pub output: &'a mut [T],
}

impl<T: Real> WithSimd for Softmax<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Along { length, inner, .. } = self.along;
        let blocks =
            self.input.chunks_exact(length * inner).zip(self.output.chunks_exact_mut(length * inner));
        for (input, output) in blocks {
            for column in 0..inner {
                let least = T::from_f32(f32::NEG_INFINITY);
                let max = (0..length).fold(least, |max, k| max.max(input[k * inner + column]));
                let mut sum = T::default();
                for k in 0..length {
                    let value = (input[k * inner + column] - max).exp();
                    output[k * inner + column] = value;
                    sum += value;
                }
                for k in 0..length {
                    output[k * inner + column] = output[k * inner + column] / sum;
                }
            }
        }
    }
}

impl Along {
    /// Writes 1 at the first maximum along the axis and 0 at all other places.
    pub fn hardmax<T: Real>(self, input: &[T], output: &mut [T]) {
        let Self { length, inner, .. } = self;
        output.fill(T::default());
        let blocks = input.chunks_exact(length * inner).zip(output.chunks_exact_mut(length * inner));
        for (input, output) in blocks {
            for column in 0..inner {
                let value = |k: usize| input[k * inner + column];
                let largest = (1..length).fold(0, |best, k| if value(k) > value(best) { k } else { best });
                output[largest * inner + column] = T::from_f32(1.0);
            }
        }
    }
}

/// Layer normalisation: each row is normalised to mean 0 and variance 1, then scaled and shifted.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerNorm<T = f32> {
    /// Factor of each column.
    pub scale: Vec<T>,
    /// Offset of each column.
    pub shift: Vec<T>,
    /// Constant added to the variance to avoid a division by zero.
    pub epsilon: T,
}

impl<T: Real> LayerNorm<T> {
    /// Normalises, scales and shifts each row.
    pub fn apply(&self, arch: Arch, input: &[T], output: &mut [T]) {
        arch.dispatch(Normalise { norm: self, input, output });
    }
}

struct Normalise<'a, T> {
    norm: &'a LayerNorm<T>,
    input: &'a [T],
    output: &'a mut [T],
}

impl<T: Real> WithSimd for Normalise<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let LayerNorm { scale, shift, epsilon } = self.norm;
        let n = scale.len();
        for (input, output) in self.input.chunks_exact(n).zip(self.output.chunks_exact_mut(n)) {
            let count = T::from_f32(n as f32);
            let mean = sum(input.iter().copied()) / count;
            let square = input.iter().fold(T::default(), |sum, x| (*x - mean).mul_add(*x - mean, sum));
            let factor = T::from_f32(1.0) / (square / count + *epsilon).sqrt();
            for (((output, x), scale), shift) in output.iter_mut().zip(input).zip(scale).zip(shift) {
                *output = (*x - mean) * factor * *scale + *shift;
            }
        }
    }
}

/// A factor and an offset for each channel (batch normalisation with fixed statistics).
#[derive(Clone, Debug, PartialEq)]
pub struct Affine<T = f32> {
    /// Factor of each channel.
    pub scale: Vec<T>,
    /// Offset of each channel.
    pub shift: Vec<T>,
    /// Count of consecutive numbers that belong to one channel.
    pub inner: usize,
}

impl<T: Real> Affine<T> {
    /// Scales and shifts all channels.
    pub fn apply(&self, input: &[T], output: &mut [T]) {
        let Self { scale, shift, inner } = self;
        let channels = input.chunks_exact(*inner).zip(output.chunks_exact_mut(*inner));
        for ((input, output), (scale, shift)) in channels.zip(scale.iter().zip(shift).cycle()) {
            for (output, x) in output.iter_mut().zip(input) {
                *output = *x * *scale + *shift;
            }
        }
    }
}
